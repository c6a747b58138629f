//! What differs between the languages that are read.

use std::collections::HashSet;
use std::sync::LazyLock;

/// How a language is written.
pub(crate) struct Language {
    /// operators and punctuation; longer ones first
    pub symbols: &'static [&'static str],
    /// the word of the language that cannot be a name
    pub reserved: fn(&str) -> Option<&'static str>,
    /// what to write instead of such a word, where no model has one
    pub instead: Option<&'static str>,
    pub is_blank: fn(char) -> bool,
    /// before a comment that ends with its line
    pub line_comment: &'static str,
    /// around any other comment
    pub comment: [&'static str; 2],
    /// whether comments may hold further ones
    pub nests: bool,
    pub starts_name: fn(char) -> bool,
    pub continues_name: fn(char) -> bool,
    /// quotes, and what they are around; longer ones first
    pub quotes: &'static [(&'static str, &'static str)],
    /// before the exponent of a number
    pub exponents: &'static [char],
    /// between the digits of a number
    pub separators: &'static [char],
    /// the refusal of a number with the word directly behind it, and what to write
    pub wrong_number: fn(&str, &str) -> Option<[&'static str; 2]>,
    /// what to write instead of a character
    pub hint: fn(char) -> Option<&'static str>,
    /// what to do where one of these signs is unexpected
    pub advice: &'static [(&'static str, &'static str)],
    /// Whether formulas are written as on paper: `x(t)` is a function of time, `2x` a product,
    /// `a^b^c` means `a^(b^c)`, a sign applies to the power behind it and may stand behind any
    /// operator, and every number is real.
    pub on_paper: bool,
    /// functions of numbers, where others are functions of time
    pub functions: &'static [&'static str],
    /// what to do about parts that are nested too deep, and about too many
    pub too_deep: &'static str,
    pub too_large: Option<&'static str>,
}

/// Whether any language has a token that is always written so.
pub(super) fn is_fixed(text: &str) -> bool {
    let mut languages = [&MODELICA, &ODE_MODEL].into_iter();
    languages.any(|it| it.symbols.contains(&text) || (it.reserved)(text).is_some())
}

/// The subset of Modelica.
pub(crate) static MODELICA: Language = Language {
    symbols: &[
        ".+", ".-", ".*", "./", ".^", ":=", "<>", "<=", ">=", "==", "+", "-", "*", "/", "^", "=",
        "<", ">", "(", ")", "[", "]", "{", "}", ",", ";", ":", ".",
    ],
    reserved: |word| RESERVED.get(word).copied(),
    instead: None,
    is_blank: |character| character.is_ascii_whitespace() || character == '\u{b}',
    line_comment: "//",
    comment: ["/*", "*/"],
    nests: false,
    // compilers name what they add with `$`
    starts_name: |character| character.is_ascii_alphabetic() || matches!(character, '_' | '$'),
    continues_name: |character| character.is_ascii_alphanumeric() || matches!(character, '_' | '$'),
    quotes: &[("\"", "string"), ("'", "quoted name")],
    exponents: &['e', 'E'],
    separators: &[],
    wrong_number: |_, word| {
        (!word.is_empty()).then_some([
            "a number runs into a name",
            "write a product with `*`; a name starts with a letter",
        ])
    },
    hint: |found| {
        Some(match found {
            '!' => "write `not a`, or `<>` for \"not equal\"",
            '&' => "write `and`",
            '|' => "write `or`",
            '%' => "write `mod(a, b)` or `rem(a, b)`",
            _ if found.is_alphabetic() => {
                "names are ASCII letters, digits and `_`; put other names in single quotes"
            }
            _ => return None,
        })
    },
    advice: &[],
    on_paper: false,
    functions: &[],
    too_deep: "name the inner parts with variables of their own",
    too_large: Some("write repetition as `for` loops"),
};

static RESERVED: LazyLock<HashSet<&str>> = LazyLock::new(|| {
    "algorithm and annotation block break class connect connector constant constrainedby der \
     discrete each else elseif elsewhen encapsulated end enumeration equation expandable extends \
     external false final flow for function if import impure in initial inner input loop model \
     not operator or outer output package parameter partial protected public pure record \
     redeclare replaceable return stream then true type when while within"
        .split_whitespace()
        .collect()
});

/// What stands between the parentheses of `@ODEmodel(…)`, a part of Julia.
pub(crate) static ODE_MODEL: Language = Language {
    symbols: &["//", "+", "-", "*", "/", "^", "=", "(", ")", ",", "'"],
    reserved: |word| JULIA.into_iter().find(|reserved| *reserved == word),
    instead: Some("a model holds equations such as `x'(t) = …` only"),
    is_blank: char::is_whitespace,
    line_comment: "#",
    comment: ["#=", "=#"],
    nests: true,
    starts_name: |character| character.is_alphabetic() || character == '_',
    // letters, digits, subscripts, accents, and `′`
    continues_name: |character| {
        let is_accent = matches!(character, '\u{300}'..='\u{36f}' | '\u{20d0}'..='\u{20ff}');
        character.is_alphanumeric() || is_accent || matches!(character, '_' | '′')
    },
    quotes: &[("\"\"\"", "string"), ("\"", "string")],
    exponents: &['e', 'E', 'f'],
    separators: &['_'],
    wrong_number: |number, word| {
        let is_wrong = number.contains('f') || number == "0" && word.starts_with(['x', 'b', 'o']);
        is_wrong.then_some([
            "this form of number is not supported",
            "numbers read `12`, `1_000`, `1//2`, `0.5` or `1.0e-3`",
        ])
    },
    hint: |found| {
        Some(match found {
            ';' => "separate equations by commas",
            '[' | ']' => "arrays are not supported: write every element as a function of its own",
            '.' => "operators on arrays are not supported: write the operator without `.`",
            '<' | '>' | '?' | '≤' | '≥' | '≠' => {
                "conditions are not supported in this notation"
            }
            '%' | '÷' => "remainders and whole quotients are not supported",
            '√' => "write `sqrt(…)`",
            '−' => "write the ASCII sign `-`",
            '·' | '⋅' | '×' => "write `*`",
            '~' => "an equation has the sign `=`",
            '@' => "macros within a model are not supported",
            '$' => "values from outside are not supported: write a parameter",
            '!' => "names have letters, digits and `_`",
            _ => return None,
        })
    },
    advice: &[
        ("'", "a derivative reads `x'(t)`"),
        ("=", "an equation has one `=`"),
    ],
    on_paper: true,
    // the original takes rational right sides only
    functions: &[
        "exp", "log", "log10", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh",
        "tanh", "abs", "sign", "min", "max",
    ],
    too_deep: "write it with fewer parentheses",
    too_large: None,
};

const JULIA: [&str; 16] = [
    "begin", "end", "if", "else", "elseif", "for", "while", "function", "let", "do", "return",
    "true", "false", "const", "in", "isa",
];
