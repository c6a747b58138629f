//! Tables of a plant: straight lines or monotone cubics, as the study says.

use crate::Folder;

/// What the sensor shows of w is a table: the derivative of y has its slope in it.
const PLANT: &str = "model Valve
  Real w(start = 0.4, min = 0.1, max = 0.9);
  Real x(start = 0.8, min = 0, max = 1);
  output Real y = Modelica.Math.Vectors.interpolate({0, 0.25, 0.5, 0.8, 1}, {0, 0.1, 0.4, 1.1, 2}, w);
equation
  der(w) = x - w;
  der(x) = 0.3 - 0.5*x;
end Valve;
";

fn folder(tables: &str) -> Folder {
    let folder = Folder::empty();
    folder.write("valve.mo", PLANT);
    let study = format!(
        "plant = \"valve.mo\"\n{tables}\n[observer]\nfamily = \"drift-observable\"\n[simulate]\nuntil = 5\noutput_step = 1\n"
    );
    folder.write("study.toml", &study);
    folder
}

/// The slope of a straight line jumps at a point of the table and ends the family; the cubic's
/// does not.
#[test]
fn a_family_that_differentiates_a_table_takes_the_cubic() {
    let lines = folder("").run(&["check", "study.toml"]);
    assert!(
        !lines.out.contains("drift-observable: fits"),
        "{}",
        lines.out
    );
    assert!(lines.out.contains("jumps"), "{}", lines.out);
    let cubic = folder("tables = \"monotone\"").run(&["check", "study.toml"]);
    assert_eq!(cubic.code, 0, "{}{}", cubic.out, cubic.err);
    assert!(
        cubic.out.contains("drift-observable: fits"),
        "{}",
        cubic.out
    );
    assert!(!cubic.out.contains("jumps"), "{}", cubic.out);
}

#[test]
fn another_word_is_refused_with_its_place() {
    let refused = folder("tables = \"cubic\"").run(&["check", "study.toml"]);
    assert_eq!(refused.code, 2);
    for words in ["study.toml:2:10", "\"linear\"", "\"monotone\""] {
        assert!(refused.err.contains(words), "{}", refused.err);
    }
}
