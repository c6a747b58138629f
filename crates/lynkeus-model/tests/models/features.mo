model Features "Arrays, functions and conditions in one model, for the comparison with another compiler"
  parameter Integer N = 5;
  parameter Real k[N] = {0.1*i for i in 1:N};
  parameter Real A[2, 2] = [0, 1; -4, -0.5];
  parameter Real B[2] = {0, 1};
  parameter Real mass = 2*k[3];
  constant Real g = 9.81;
  input Real u(start = 0.3, min = -1, max = 1);
  Real z[2](start = {1, -1}) "Oscillator";
  Real x[N](start = {1, 0.8, 0.6, 0.4, 0.2}) "Diffusion";
  Real p(start = 0.5) "Pendulum";
  Real v(start = 0);
  Real w(start = 0.1) "Everything else";
  Real force;
  Real total = sum(x);
  output Real energy = 0.5*mass*v^2 + g*(1 - cos(p));
equation
  der(z) = A*z + B*u;
  der(x[1]) = k[1]*(x[2] - x[1]);
  for i in 2:N - 1 loop
    der(x[i]) = k[i]*(x[i - 1] - 2*x[i] + x[i + 1]);
  end for;
  (1 + k[N])*der(x[N]) = k[N]*(x[N - 1] - x[N]);
  der(p) = v;
  force - mass*g*sin(p) = 0.1*v*abs(v);
  0 = mass*der(v) + force;
  der(w) = (if total > 100 then -w elseif total < 10 then 0.1 else 0.2) + 0.1*atan2(w, 1 + total)
    + 0.05*tanh(w) + 0.01*(exp(-w) + log(1 + w^2) + sqrt(1 + w^2)) + 0.02*max(w, min(total, 0.3));
end Features;
