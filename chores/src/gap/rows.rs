//! What the table is about: shipped studies, their tunings, and the boxes on which the
//! three answers are compared.

/// One row of the table.
pub struct Row {
    pub label: &'static str,
    /// relative to `examples`
    pub study: &'static str,
    /// the key that is scaled
    pub key: &'static str,
    /// the power of the factor for each entry of a list; 1 for those not named
    pub powers: &'static [i32],
    /// the box in words
    pub place: &'static str,
    /// appended to the study: `[box]`, `[certify]`
    pub certify: &'static str,
    /// further lines of `[observer]`
    pub observer: &'static str,
    pub unknown: &'static [&'static str],
    /// share of the box, about the study's start, from which plant and estimate start
    pub spread: f64,
    /// when the error has to be below one per cent
    pub by: f64,
    pub unit: &'static str,
    /// the theorem's constant and how the table writes it; none where the theorem is about
    /// another observer (a gain divided by partials) or needs what the study does not say
    pub theorem: Option<(&'static str, &'static str)>,
    /// keys of the study that the theorem is asked without
    pub theorem_without: &'static [&'static str],
    /// appended to the study for the theorem; the declared box is this being empty
    pub theorem_with: &'static str,
    /// why no inequality is asked
    pub inequality: Option<&'static str>,
    /// whether `gain = "lmi"` is asked, too
    pub redesign: bool,
}

/// A study with a scalar theta on its declared box, simulated for ten units of time.
const PLAIN: Row = Row {
    label: "",
    study: "",
    key: "theta",
    powers: &[],
    place: "declared",
    certify: "",
    observer: "",
    unknown: &[],
    spread: 1.0,
    by: 10.0,
    unit: "s",
    theorem: Some(("θ0", "θ0")),
    theorem_without: &[],
    theorem_with: "",
    inequality: None,
    redesign: false,
};

const LEE: &str = "[box]\nx1 = [-3.5, 3.5]\nx2 = [-4, 4]\nx3 = [-3.5, 3.5]\nx4 = [-4, 4]";
const PAIR: &str = "[box]\nq1 = [-2.4, 2.4]\nv1 = [-4, 4]\nq2 = [-2.4, 2.4]\nv2 = [-4, 4]";

pub const ROWS: &[Row] = &[
    Row {
        label: "[column](../examples/column), whole",
        study: "column/study.toml",
        place: "declared, L and V of the study",
        unknown: &["Zf"],
        by: 60.0,
        unit: "min",
        theorem_without: &["S"],
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[column](../examples/column), near its start",
        study: "column/study.toml",
        place: "compositions within 0.15 of the start",
        certify: "[certify]\ntube = 0.15",
        unknown: &["Zf"],
        by: 60.0,
        unit: "min",
        theorem_without: &["S"],
        theorem_with: "[certify]\ntube = 0.15",
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[Lee et al.](../examples/lee), classical (3)",
        study: "lee/classical.toml",
        powers: &[1, 2],
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[Lee et al.](../examples/lee), (7)",
        study: "lee/study.toml",
        powers: &[1, 2],
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[Lee et al.](../examples/lee), classical (3), near its orbit",
        study: "lee/classical.toml",
        powers: &[1, 2],
        place: "\\|x1\\|, \\|x3\\| ≤ 3.5; \\|x2\\|, \\|x4\\| ≤ 4",
        certify: LEE,
        spread: 0.4,
        theorem_with: LEE,
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[Lee et al.](../examples/lee), (7), near its orbit",
        study: "lee/study.toml",
        powers: &[1, 2],
        place: "\\|x1\\|, \\|x3\\| ≤ 3.5; \\|x2\\|, \\|x4\\| ≤ 4",
        certify: LEE,
        spread: 0.4,
        theorem_with: LEE,
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[Ltaief et al.](../examples/ltaief)",
        study: "ltaief/study.toml",
        spread: 0.5,
        inequality: Some("S(t) is a state"),
        ..PLAIN
    },
    Row {
        label: "[Germani, Manes](../examples/germani-manes), (4.1)",
        study: "germani-manes/theoretical.toml",
        key: "poles",
        spread: 0.3,
        theorem: Some(("s0", "poles ×")),
        ..PLAIN
    },
    Row {
        label: "[Farza et al.](../examples/farza)",
        study: "farza/study.toml",
        unknown: &["v"],
        spread: 0.1,
        theorem: Some(("θ1,0", "θ1")),
        // no slope bound at the study's θ, see the page; each trial takes minutes
        inequality: Some("not searched"),
        ..PLAIN
    },
    Row {
        label: "[two tanks](../examples/two-tanks)",
        study: "two-tanks/study.toml",
        place: "upper in [2, 8], lower in [1, 10]",
        unknown: &["pump"],
        spread: 0.5,
        by: 2000.0,
        theorem: None,
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[stirred tank](../examples/cstr)",
        study: "cstr/study.toml",
        place: "C in [0.6, 1.2], T in [322, 332], Cin in [0.8, 1.3]",
        certify: "[box]\nC = [0.6, 1.2]\nT = [322, 332]\nCin = [0.8, 1.3]",
        unknown: &["Cin"],
        spread: 0.5,
        by: 20.0,
        unit: "min",
        theorem: None,
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[bioreactor](../examples/bioreactor)",
        study: "bioreactor/study.toml",
        place: "X in [2, 6]",
        certify: "[box]\nX = [2, 6]",
        unknown: &["mu"],
        spread: 0.2,
        by: 30.0,
        unit: "h",
        theorem: None,
        ..PLAIN
    },
    Row {
        label: "[pair of oscillators](../examples/van-der-pol-pair)",
        study: "van-der-pol-pair/study.toml",
        by: 20.0,
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[pair of oscillators](../examples/van-der-pol-pair), near its orbit",
        study: "van-der-pol-pair/study.toml",
        place: "\\|q1\\|, \\|q2\\| ≤ 2.4; \\|v1\\|, \\|v2\\| ≤ 4",
        certify: PAIR,
        spread: 0.4,
        by: 20.0,
        theorem_with: PAIR,
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[quadrotor](../examples/quadrotor)",
        study: "quadrotor/study.toml",
        place: "v in [−5, 5], wind in [−5, 5]",
        certify: "[box]\nv = [-5, 5]\nwind = [-5, 5]",
        unknown: &["wind"],
        spread: 0.05,
        by: 20.0,
        theorem: None,
        redesign: true,
        ..PLAIN
    },
    Row {
        label: "[predators and prey](../examples/predator-prey)",
        study: "predator-prey/study.toml",
        key: "poles",
        place: "hares in [1.5, 4.5], lynxes in [0.6, 1.8]",
        certify: "[box]\nhares = [1.5, 4.5]\nlynxes = [0.6, 1.8]",
        spread: 0.5,
        by: 20.0,
        unit: "years",
        theorem: Some(("s0", "poles ×")),
        theorem_with: "[box]\nhares = [1.5, 4.5]\nlynxes = [0.6, 1.8]",
        ..PLAIN
    },
    Row {
        label: "[induction motor](../examples/induction-motor)",
        study: "induction-motor/study.toml",
        unknown: &["load"],
        spread: 0.2,
        by: 0.5,
        inequality: Some("S(t) is a state"),
        ..PLAIN
    },
];
