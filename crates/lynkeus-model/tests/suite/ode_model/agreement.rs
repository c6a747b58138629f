//! The same model in both notations has the same right sides.

use lynkeus_expr::{Node, Tape};
use lynkeus_model::Plant;
use proptest::prelude::*;

use super::{symbolic, taken};

const GOODWIN: (&str, &str) = (
    "@ODEmodel(
        x1'(t) = -b * x1(t) + 1 / (c + x4(t)),
        x2'(t) = alpha * x1(t) - beta * x2(t),
        x3'(t) = gama * x2(t) - delta * x3(t),
        x4'(t) = sigma * x4(t) * (gama * x2(t) - delta * x3(t)) / x3(t),
        y(t) = x1(t)
    )",
    "model Goodwin
        parameter Real b; parameter Real c; parameter Real alpha; parameter Real beta;
        parameter Real gama; parameter Real delta; parameter Real sigma;
        Real x1; Real x2; Real x3; Real x4;
        output Real y = x1;
    equation
        der(x1) = -b * x1 + 1 / (c + x4);
        der(x2) = alpha * x1 - beta * x2;
        der(x3) = gama * x2 - delta * x3;
        der(x4) = sigma * x4 * (gama * x2 - delta * x3) / x3;
    end Goodwin;",
);

const CHOLERA: (&str, &str) = (
    "@ODEmodel(
        S'(t) = mu - bi * S(t) * I(t) - bw * S(t) * W(t) - mu * S(t) + a * R(t),
        I'(t) = bw * S(t) * W(t) + bi * S(t) * I(t) - (gam + mu) * I(t),
        W'(t) = xi * (I(t) - W(t)),
        R'(t) = gam * I(t) - (mu + a) * R(t),
        y(t) = k * I(t),
        y2(t) = S(t) + I(t) + R(t)
    )",
    "model Cholera
        parameter Real mu; parameter Real bi; parameter Real bw; parameter Real a;
        parameter Real gam; parameter Real xi; parameter Real k;
        Real S; Real I; Real W; Real R;
        output Real y = k*I;
        output Real y2 = S + I + R;
    equation
        der(S) = mu - bi*S*I - bw*S*W - mu*S + a*R;
        der(I) = bw*S*W + bi*S*I - (gam + mu)*I;
        der(W) = xi*(I - W);
        der(R) = gam*I - (mu + a)*R;
    end Cholera;",
);

const VIRUS: (&str, &str) = (
    "@ODEmodel(
        w'(t) = -b*w(t) + c*w(t)*x(t)*y(t) - c*w(t)*q*y(t),
        v'(t) = k*y(t) - v(t)*u,
        x'(t) = lm - x(t)*d - x(t)*v(t)*beta,
        z'(t) = c*w(t)*q*y(t) - h*z(t),
        y'(t) = x(t)*v(t)*beta - a*y(t),
        y2(t) = z(t),
        y1(t) = w(t)
    )",
    "model Virus
        parameter Real b; parameter Real c; parameter Real q; parameter Real k; parameter Real u;
        parameter Real lm; parameter Real d; parameter Real beta; parameter Real h;
        parameter Real a;
        Real w; Real v; Real x; Real z; Real y;
        output Real y2 = z; output Real y1 = w;
    equation
        der(w) = -b*w + c*w*x*y - c*w*q*y;
        der(v) = k*y - v*u;
        der(x) = lm - x*d - x*v*beta;
        der(z) = c*w*q*y - h*z;
        der(y) = x*v*beta - a*y;
    end Virus;",
);

const REACTOR: (&str, &str) = (
    "@ODEmodel(
        Ca'(t) = u1(t)*(Ca0 - Ca(t))//V - k0*Arr(t)*Ca(t),
        T'(t) = u1(t)*(Ta - T(t))//V - (k0*Arr(t)*Ca(t)*DH + UA*(Tj(t) - T(t))//V)//(ro*cp),
        Tj'(t) = u2(t)*(Th - Tj(t))//Vh - UA//(roh*cph)*(Tj(t) - T(t))//Vh,
        Arr'(t) = E*Arr(t)//(R*T(t)^2) + 1//3*exp(-T(t)/10),
        y1(t) = T(t)
    )",
    "model Reactor
        parameter Real Ca0; parameter Real V; parameter Real k0; parameter Real Ta;
        parameter Real DH; parameter Real UA; parameter Real ro; parameter Real cp;
        parameter Real Th; parameter Real Vh; parameter Real roh; parameter Real cph;
        parameter Real E; parameter Real R;
        input Real u1; input Real u2;
        Real Ca; Real T; Real Tj; Real Arr;
        output Real y1 = T;
    equation
        der(Ca) = u1*(Ca0 - Ca)/V - k0*Arr*Ca;
        der(T) = u1*(Ta - T)/V - (k0*Arr*Ca*DH + UA*(Tj - T)/V)/(ro*cp);
        der(Tj) = u2*(Th - Tj)/Vh - UA/(roh*cph)*(Tj - T)/Vh;
        der(Arr) = E*Arr/(R*T^2) + 1/3*exp(-T/10);
    end Reactor;",
);

/// Derivatives and outputs as code over states, inputs and parameters, with the names of these.
fn compiled(plant: &Plant) -> (Tape, Vec<String>) {
    let parameters = plant.parameters.iter().map(|parameter| &parameter.variable);
    let symbols = plant.states.iter().chain(&plant.inputs).chain(parameters);
    let symbols: Vec<(Node, String)> = symbols.map(|v| (v.node, v.name.clone())).collect();
    let nodes: Vec<Node> = symbols.iter().map(|(node, _)| *node).collect();
    let mut roots = plant.derivatives.clone();
    roots.extend(plant.outputs.iter().map(|output| output.node));
    let tape = Tape::new(&plant.graph, &nodes, &roots).unwrap();
    (tape, symbols.into_iter().map(|(_, name)| name).collect())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn right_sides_agree(numbers in prop::collection::vec(0.1..3.0, 24)) {
        for (julia, modelica) in [GOODWIN, CHOLERA, VIRUS, REACTOR] {
            let ours = taken(julia);
            let theirs = Plant::from_modelica(modelica, "m.mo", &symbolic()).unwrap();
            let ((left, names), (right, their_names)) = (compiled(&ours), compiled(&theirs));
            prop_assert_eq!(&names, &their_names);
            let count = ours.derivatives.len() + ours.outputs.len();
            let (mut a, mut b) = (vec![0.0; count], vec![0.0; count]);
            left.evaluator().eval(&numbers[..names.len()], &mut a);
            right.evaluator().eval(&numbers[..names.len()], &mut b);
            for (a, b) in a.iter().zip(&b) {
                prop_assert!((a - b).abs() <= 1e-12*(1.0 + a.abs()), "{} {}", a, b);
            }
        }
    }
}
