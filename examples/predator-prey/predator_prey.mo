model PredatorPrey "Hares that are counted and lynxes that hide; time in years"
  parameter Real r(unit = "1/y") = 1.5 "Growth of the hares";
  parameter Real K = 6 "Hares that the land can feed, in thousands";
  parameter Real a(unit = "1/y") = 1.2 "Hunt";
  parameter Real b = 0.4 "Saturation of the hunt";
  parameter Real e = 0.6 "Lynxes per hare eaten";
  parameter Real m(unit = "1/y") = 0.8 "Death of the lynxes";
  Real hares(start = 3, min = 0.2, max = 8) "Prey, in thousands";
  Real lynxes(start = 1, min = 0.05, max = 6) "Predators, in thousands";
  Real hunt(unit = "1/y") "Hares eaten, per lynx";
  output Real count = hares "The census";
equation
  hunt = a*hares/(1 + b*hares);
  der(hares) = r*hares*(1 - hares/K) - hunt*lynxes;
  der(lynxes) = e*hunt*lynxes - m*lynxes;
  annotation(experiment(StopTime = 40));
end PredatorPrey;
