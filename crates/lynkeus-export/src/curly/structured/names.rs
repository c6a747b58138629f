//! Names of IEC 61131-3: without regard to case, no `_` after another or at an end, and none of the many words
//! that one programming system or another has taken.

use std::collections::HashSet;

/// Keywords, types and functions of the standard, operators that CODESYS and TwinCAT add, and words of Siemens'
/// SCL.
const RESERVED: &str = "
abs abstract acos action add adr and and_then andn any any_bit any_date any_int any_num any_real array asin at atan
atan2 begin bit bitadr block bool by byte cal calc calcn case ceil char class concat configuration constant continue
cosh cos counter ctd ctu ctud data_block date date_and_time delete derivative dint div do dt dword else elsif en end
end_action end_block end_case end_class end_configuration end_for end_function end_function_block end_if
end_interface end_method end_namespace end_organization_block end_program end_repeat end_resource end_step
end_struct end_transition end_type end_var end_while eno eq exit exp expt extends f_edge f_trig false final find
finite floor for from function function_block ge global get goto gt if implements in ini initial_step insert int
integral interface internal interval isnan jmp jmpc jmpcn label ld ldate ldn ldt le left len limit lint ln log
lower_bound lreal lt ltime ltod lword max method mid min mod move mul mux namespace ne nil non_retain not null of ok
on or or_else orn organization_block overlap override params persistent pi pid pointer priority private program property
protected public query r_edge r_trig ramp read_only read_write real ref ref_to reference region repeat replace
resource ret retain retc return right rol ror round rs rtc sel sema set shl shr sign sin single sinh sint sizeof
sqrt sr st step stn string struct sub super tan tanh task then this time time_of_day timer to tod tof ton tp transition
true trunc type udint uint ulint union until upper_bound usint using var var_access var_config var_external
var_global var_in_out var_input var_output var_temp version void while with word write_var wstring wchar xor xorn
";

/// Types of numbers, between which there are functions like REAL_TO_LREAL and TO_REAL.
const TYPES: [&str; 20] = [
    "bool", "byte", "date", "dint", "dt", "dword", "int", "lint", "lreal", "lword", "real", "sint",
    "string", "time", "tod", "udint", "uint", "ulint", "usint", "word",
];

/// Names that are given out, each once.
#[derive(Clone, Debug, Default)]
pub(super) struct Identifiers {
    taken: HashSet<String>,
    /// what the program is called; after it and `_` stand the names of its functions and types
    program: String,
    /// without that, and without the number that more than one have
    global: HashSet<String>,
}

impl Identifiers {
    /// Without those that are taken already.
    pub fn without(taken: &[&str]) -> Self {
        Self {
            taken: taken.iter().map(|name| name.to_lowercase()).collect(),
            ..Self::default()
        }
    }

    /// Without the names of a program: its own, and those that begin with it.
    pub fn inside<'n>(program: &str, global: impl IntoIterator<Item = &'n str>) -> Self {
        Self {
            taken: HashSet::from([program.to_lowercase()]),
            program: program.to_lowercase(),
            global: global.into_iter().map(str::to_lowercase).collect(),
        }
    }

    /// Without these, too.
    pub fn and_without(mut self, taken: &[&str]) -> Self {
        self.taken
            .extend(taken.iter().map(|name| name.to_lowercase()));
        self
    }

    /// A name like this one that is nobody else's.
    pub fn of(&mut self, name: &str) -> String {
        let mut stem = plain(name);
        if self.is_global(&stem.to_lowercase()) {
            stem.insert_str(0, "v_");
        }
        let mut found = stem.clone();
        let mut number = 0;
        while !self.is_free(&found) {
            number += 1;
            found = format!("{stem}_{number}");
        }
        self.taken.insert(found.to_lowercase());
        found
    }

    fn is_free(&self, name: &str) -> bool {
        let name = name.to_lowercase();
        !self.taken.contains(&name)
            && !self.is_global(&name)
            && !is_conversion(&name)
            && !RESERVED.split_whitespace().any(|word| word == name)
    }

    /// Whether a function or a type of the program is called so, or may be.
    fn is_global(&self, name: &str) -> bool {
        let rest = name.strip_prefix(&self.program);
        let Some(rest) = rest.and_then(|rest| rest.strip_prefix('_')) else {
            return false;
        };
        let stem = match rest.rsplit_once('_') {
            Some((stem, number)) if number.bytes().all(|c| c.is_ascii_digit()) => stem,
            _ => rest,
        };
        self.global.contains(stem) || self.global.contains(rest)
    }
}

fn is_conversion(name: &str) -> bool {
    match name.split_once("to_") {
        Some(("", to)) => TYPES.contains(&to),
        Some((from, to)) => {
            let from = from.strip_suffix('_').unwrap_or(from);
            TYPES.contains(&from) && TYPES.contains(&to)
        }
        None => false,
    }
}

/// Letters, digits and single underscores, a letter first.
pub(super) fn plain(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    let joined = words.join("_");
    if !joined.starts_with(|c: char| c.is_ascii_alphabetic()) {
        return format!("v{joined}");
    }
    // there are compilers that take such a name after declarations for the beginning of others
    match joined.to_lowercase().starts_with("var") {
        true => format!("a_{joined}"),
        false => joined,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_legal_and_differ_in_more_than_case() {
        let mut names = Identifiers::inside("tank", ["flow", "reals"]);
        let mut of = |name: &str| names.of(name);
        assert_eq!(of("Level"), "Level");
        assert_eq!(of("level"), "level_1");
        assert_eq!(of("a__b_"), "a_b");
        assert_eq!(of("a_b"), "a_b_1");
        assert_eq!(of("Real"), "Real_1");
        assert_eq!(of("to"), "to_1");
        assert_eq!(of("time"), "time_1");
        assert_eq!(of("tank_Reals_3"), "v_tank_Reals_3");
        assert_eq!(of("tank_flow"), "v_tank_flow");
        assert_eq!(of("tank_flow_rate"), "tank_flow_rate");
        assert_eq!(of("Tank"), "Tank_1");
        assert_eq!(of("real_to_Lreal"), "real_to_Lreal_1");
        assert_eq!(of("pump_to_tank"), "pump_to_tank");
        assert_eq!(of("_2"), "v2");
        assert_eq!(of("θ"), "v");
        assert_eq!(of("Variance"), "a_Variance");
    }
}
