//! A model's equations to a syntax tree; expressions have the precedence they have in Julia.

use lynkeus_expr::Binary;

use super::lexer::{SYMBOLS, token};
use crate::diagnostic::{Problem, Result, Span};
use crate::names::did_you_mean;
use crate::syntax::ast::{Ast, Call, ExprId, Kind};
use crate::syntax::{Language, Lexer, PRODUCT, Parser, SUM, Token, shortened};

/// What a name is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    State,
    Output,
    Input,
    Parameter,
}

/// A model while it is read, and what was found so far.
pub(super) struct ParsedModel<'s> {
    lexer: Lexer<'s>,
    /// the word `@ODEmodel`
    pub head: Span,
    /// names on the left sides with what is on the right
    pub equations: Vec<(Span, Role, ExprId)>,
    /// names on the right sides, in order
    pub mentions: Vec<(Span, Role)>,
}

/// Parses the model that begins with the word at `head`.
pub(super) fn parse(source: &str, head: Span) -> Result<(ParsedModel<'_>, Ast)> {
    let mut lexer = Lexer::new(source);
    lexer.position = head.end as usize;
    let model = ParsedModel {
        lexer,
        head,
        equations: vec![],
        mentions: vec![],
    };
    let mut parser = Parser::behind(head, source, model);
    parser.opening()?;
    parser.equations(head)?;
    Ok((parser.language, parser.ast))
}

impl<'s> Language<'s> for ParsedModel<'s> {
    const NESTED: &'static str = "write it with fewer parentheses";

    fn next(&mut self) -> Result<(Token, Span)> {
        token(&mut self.lexer)
    }

    fn is_fixed(text: &str) -> bool {
        SYMBOLS.contains(&text)
    }

    fn level(operator: &str) -> Option<u8> {
        Some(match operator {
            "+" | "-" => SUM,
            "*" | "/" => PRODUCT,
            // `1/2//3` is `1/(2//3)`
            "//" => PRODUCT + 1,
            _ => return None,
        })
    }

    fn operand(parser: &mut Parser<'s, Self>, _least: u8) -> Result<ExprId> {
        parser.operand()
    }

    fn too_large(&self, limit: &str, span: Span) -> Problem {
        let message = format!("the model has more than {limit} operands and operators");
        Problem::new(span, message)
    }

    fn hint_at_end(&self) -> Option<String> {
        let line = self.head.line(self.lexer.source);
        Some(format!("close the model of line {line} with `)`"))
    }
}

impl<'s> Parser<'s, ParsedModel<'s>> {
    /// The parenthesis behind `@ODEmodel`.
    fn opening(&mut self) -> Result<()> {
        let rest = self.source.get(self.span.end as usize..);
        let rest = rest.unwrap_or_default();
        if !rest.starts_with('(') {
            let problem = Problem::new(self.span, "expected `(` directly behind `@ODEmodel`");
            return Err(problem.hint("a model reads `@ODEmodel(x'(t) = …, y(t) = …)`"));
        }
        self.advance()?;
        self.advance()?;
        Ok(())
    }

    fn equations(&mut self, head: Span) -> Result<()> {
        while !self.at(")") {
            self.equation()?;
            if self.at(")") || self.accept(",")? {
                continue;
            }
            let between = Span::new(self.last.end as usize, self.span.start as usize);
            let is_next_line = between.text(self.source).contains('\n');
            if !is_next_line || self.token == Token::End {
                return Err(self.unexpected("an operator, `,` or `)`"));
            }
        }
        if self.language.equations.is_empty() {
            let problem = Problem::new(head, "the model has no equations");
            return Err(problem.hint("write `x'(t) = …` for states and `y(t) = …` for outputs"));
        }
        Ok(())
    }

    fn equation(&mut self) -> Result<()> {
        let name = self.left_name()?;
        let is_derivative = self.accept("'")?;
        if is_derivative && self.at("'") {
            return Err(self.second_derivative(name));
        }
        if self.at("=") {
            let text = name.text(self.source);
            let prime = if is_derivative { "'" } else { "" };
            let problem = self.unexpected(&format!("`(t)` behind `{text}{prime}`"));
            let hint = format!("write `{text}'(t) = …` for a state, `{text}(t) = …` for an output");
            return Err(problem.hint(hint));
        }
        self.expect("(")?;
        self.time_argument(name)?;
        if self.at("'") {
            let text = name.text(self.source);
            let problem = self.unexpected("`=`");
            return Err(problem.hint(format!("a derivative reads `{text}'(t)`")));
        }
        self.expect("=")?;
        let right = self.expression()?;
        self.count(1)?;
        let role = match is_derivative {
            true => Role::State,
            false => Role::Output,
        };
        self.language.equations.push((name, role, right));
        Ok(())
    }

    fn left_name(&mut self) -> Result<Span> {
        if self.token == Token::Identifier {
            return self.advance();
        }
        let problem = self.unexpected("an equation or `)`");
        let hint = "equations read `x'(t) = …` for a state, `y(t) = …` for an output";
        Err(match self.token {
            Token::End => problem,
            _ => problem.hint(hint),
        })
    }

    fn second_derivative(&self, name: Span) -> Problem {
        let text = name.text(self.source);
        let span = name.to(self.span);
        Problem::new(span, "derivatives of higher order are not supported").hint(format!(
            "add a state for the velocity: `{text}'(t) = v(t)` and `v'(t) = …`"
        ))
    }

    /// `t)` behind the opening parenthesis of the function `name`.
    pub(super) fn time_argument(&mut self, name: Span) -> Result<()> {
        if self.at_time() {
            self.advance()?;
            if self.accept(")")? {
                return Ok(());
            }
        }
        let text = name.text(self.source);
        Err(self
            .unexpected(&format!("`{text}(t)`"))
            .hint("functions have the argument `t` alone: no delays, no discrete time"))
    }

    pub(super) fn at_time(&self) -> bool {
        self.token == Token::Identifier && self.span.text(self.source) == "t"
    }
}

/// Functions of numbers. The original takes rational right sides only.
const FUNCTIONS: [&str; 17] = [
    "exp", "log", "log10", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh",
    "tanh", "abs", "sign", "min", "max",
];

/// Whether the name is that of a function of numbers.
pub(super) fn is_elementary(name: &str) -> bool {
    FUNCTIONS.contains(&name)
}

impl<'s> Parser<'s, ParsedModel<'s>> {
    /// Any expression.
    pub(super) fn expression(&mut self) -> Result<ExprId> {
        self.operators(SUM)
    }

    /// A power with signs before it: `-x^2` is −(x²).
    fn operand(&mut self) -> Result<ExprId> {
        let kind = match self.token {
            Token::Fixed("-") => Kind::Minus,
            Token::Fixed("+") => Kind::Plus,
            _ => return self.power(),
        };
        let (start, first) = (self.advance()?, self.next_id());
        let operand = self.nested(Self::operand)?;
        self.push(kind(operand), start, first)
    }

    /// `a^b`, from the right; or a number directly before its factor, which binds tighter than
    /// any operator but the power: `1/2x^2` is 1/(2x²).
    fn power(&mut self) -> Result<ExprId> {
        let (start, first) = (self.span, self.next_id());
        let is_number = self.token == Token::Real;
        let base = self.primary()?;
        let is_adjacent = self.last.end == self.span.start;
        if is_number && is_adjacent && (self.token == Token::Identifier || self.at("(")) {
            let factor = self.nested(Self::power)?;
            let product = vec![(Binary::Mul, false, factor)];
            return self.push(Kind::Chain(base, product), start, first);
        }
        if !self.accept("^")? {
            return Ok(base);
        }
        let exponent = self.nested(Self::operand)?;
        self.push(Kind::Power(base, exponent, false), start, first)
    }

    fn primary(&mut self) -> Result<ExprId> {
        match self.token {
            Token::Real => self.number(),
            Token::Identifier => self.name(),
            Token::Fixed("(") => {
                self.advance()?;
                let inner = self.expression()?;
                self.expect(")")?;
                Ok(inner)
            }
            Token::Fixed("=") => {
                let problem = self.unexpected("an operand");
                Err(problem.hint("an equation has one `=`"))
            }
            _ => Err(self.unexpected("an operand")),
        }
    }

    fn number(&mut self) -> Result<ExprId> {
        let (span, first) = (self.span, self.next_id());
        let value = self.real_value()?;
        self.advance()?;
        self.push(Kind::Real(value), span, first)
    }

    /// `a`, `x(t)`, `exp(…)`.
    fn name(&mut self) -> Result<ExprId> {
        let first = self.next_id();
        let is_time = self.at_time();
        let name = self.advance()?;
        if self.at("'") {
            return Err(self.derivative(name));
        }
        let is_function = self.at("(");
        if is_function && is_elementary(name.text(self.source)) {
            return self.call(name, first);
        }
        if is_function {
            self.advance()?;
            if !self.at_time() {
                return Err(self.unknown_function(name));
            }
            self.time_argument(name)?;
            if self.at("'") {
                return Err(self.derivative(name));
            }
            self.language.mentions.push((name, Role::Input));
        } else if !is_time {
            self.language.mentions.push((name, Role::Parameter));
        }
        self.push_at(Kind::Name, name, first)
    }

    fn call(&mut self, function: Span, first: ExprId) -> Result<ExprId> {
        self.advance()?;
        let mut arguments = vec![];
        while !self.at(")") {
            arguments.push(self.expression()?);
            if !self.accept(",")? {
                break;
            }
        }
        self.expect(")")?;
        let call = Call {
            function,
            arguments,
            ..Call::default()
        };
        self.push(Kind::Call(call), function, first)
    }

    fn derivative(&self, name: Span) -> Problem {
        let text = name.text(self.source);
        let span = name.to(self.span);
        Problem::new(span, "a derivative on a right side is not supported").hint(format!(
            "write what `{text}'(t)` is equal to, from its own equation"
        ))
    }

    fn unknown_function(&self, name: Span) -> Problem {
        let text = name.text(self.source);
        let hint = did_you_mean(text, FUNCTIONS.into_iter()).unwrap_or_else(|| {
            let known = FUNCTIONS.join(" ");
            format!("functions of time read `{text}(t)`, products `{text}*(…)`; there are {known}")
        });
        let message = format!("unknown function `{}`", shortened(text));
        Problem::new(name, message).hint(hint)
    }
}
