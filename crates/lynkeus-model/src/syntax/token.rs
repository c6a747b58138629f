//! The words of Modelica.

/// One token; its text is the source under its span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Token {
    Identifier,
    Integer,
    Real,
    Text,
    Keyword(Keyword),
    Symbol(Symbol),
    /// the end of the text
    End,
}

macro_rules! words {
    ($(#[$doc:meta])* $kind:ident, $($name:ident = $text:literal),* $(,)?) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum $kind { $($name),* }

        impl $kind {
            /// How it is written.
            pub(crate) fn text(self) -> &'static str {
                match self { $(Self::$name => $text),* }
            }

            /// Every one, with how it is written.
            pub(crate) const ALL: &[(&'static str, Self)] = &[$(($text, Self::$name)),*];
        }
    };
}

words! {
    /// Reserved words.
    Keyword,
    Algorithm = "algorithm", And = "and", Annotation = "annotation", Block = "block",
    Break = "break", Class = "class", Connect = "connect", Connector = "connector",
    Constant = "constant", Constrainedby = "constrainedby", Der = "der", Discrete = "discrete",
    Each = "each", Else = "else", Elseif = "elseif", Elsewhen = "elsewhen",
    Encapsulated = "encapsulated", End = "end", Enumeration = "enumeration",
    Equation = "equation", Expandable = "expandable", Extends = "extends",
    External = "external", False = "false", Final = "final", Flow = "flow", For = "for",
    Function = "function", If = "if", Import = "import", Impure = "impure", In = "in",
    Initial = "initial", Inner = "inner", Input = "input", Loop = "loop", Model = "model",
    Not = "not", Operator = "operator", Or = "or", Outer = "outer", Output = "output",
    Package = "package", Parameter = "parameter", Partial = "partial", Protected = "protected",
    Public = "public", Pure = "pure", Record = "record", Redeclare = "redeclare",
    Replaceable = "replaceable", Return = "return", Stream = "stream", Then = "then",
    True = "true", Type = "type", When = "when", While = "while", Within = "within",
}

words! {
    /// Operators and punctuation; longer ones first.
    Symbol,
    ElementPlus = ".+", ElementMinus = ".-", ElementTimes = ".*", ElementOver = "./",
    ElementPower = ".^", Assign = ":=", NotEqual = "<>", LessEqual = "<=",
    GreaterEqual = ">=", EqualEqual = "==", Plus = "+", Minus = "-", Times = "*", Over = "/",
    Power = "^", Equal = "=", Less = "<", Greater = ">", OpenParen = "(", CloseParen = ")",
    OpenBracket = "[", CloseBracket = "]", OpenBrace = "{", CloseBrace = "}", Comma = ",",
    Semicolon = ";", Colon = ":", Dot = ".",
}

impl Token {
    /// How a message names it.
    pub(crate) fn describe(self, text: &str) -> String {
        match self {
            Token::Identifier | Token::Integer | Token::Real => format!("`{}`", shortened(text)),
            Token::Text => "a string".to_owned(),
            Token::Keyword(keyword) => format!("`{}`", keyword.text()),
            Token::Symbol(symbol) => format!("`{}`", symbol.text()),
            Token::End => "the end of the text".to_owned(),
        }
    }
}

/// At most 40 characters of a text.
pub(crate) fn shortened(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}
