//! The equations of a model.

use crate::diagnostic::{Problem, Result, Span};
use crate::syntax::ast::{Ast, ExprId, Kind};
use crate::syntax::{Lexer, ODE_MODEL, Parser, Token};

/// The left and the right sides of a model's equations.
pub(super) type Equations = Vec<(ExprId, ExprId)>;

/// Parses the model that begins with the word at `head`.
pub(super) fn parse(source: &str, head: Span) -> Result<(Equations, Ast)> {
    let mut lexer = Lexer::new(source, &ODE_MODEL);
    lexer.position = head.end as usize;
    if !lexer.rest().starts_with('(') {
        let problem = Problem::new(head, "expected `(` directly behind `@ODEmodel`");
        return Err(problem.hint("a model reads `@ODEmodel(x'(t) = …, y(t) = …)`"));
    }
    let mut parser = Parser::at_first(lexer)?;
    let equations = parser.equations().map_err(|problem| match parser.token {
        Token::End => {
            let line = head.line(source);
            problem.or_hint(format!("close the model of line {line} with `)`"))
        }
        _ => problem,
    })?;
    if equations.is_empty() {
        let problem = Problem::new(head, "the model has no equations");
        return Err(problem.hint("write `x'(t) = …` for states and `y(t) = …` for outputs"));
    }
    Ok((equations, parser.ast))
}

impl Parser<'_> {
    /// Equations in parentheses, with commas or ends of lines between them.
    fn equations(&mut self) -> Result<Equations> {
        self.expect("(")?;
        let mut equations = vec![];
        while !self.at(")") {
            equations.push(self.of_time()?);
            if self.at(")") || self.accept(",")? {
                continue;
            }
            let between = Span::new(self.last.end as usize, self.span.start as usize);
            let is_next_line = between.text(self.source).contains('\n');
            if !is_next_line || self.token == Token::End {
                return Err(self.unexpected("an operator, `,` or `)`"));
            }
        }
        Ok(equations)
    }

    /// `x'(t) = …` or `y(t) = …`.
    fn of_time(&mut self) -> Result<(ExprId, ExprId)> {
        if self.token != Token::Identifier {
            let problem = self.unexpected("an equation or `)`");
            let hint = "equations read `x'(t) = …` for a state, `y(t) = …` for an output";
            let is_end = self.token == Token::End;
            return Err(if is_end { problem } else { problem.hint(hint) });
        }
        let left = self.function_of_time()?;
        let expression = self.ast.expression(left);
        if matches!(expression.kind, Kind::Name) {
            let written = expression.span.text(self.source);
            let name = written.trim_end_matches('\'');
            let problem = self.unexpected(&format!("`(t)` behind `{written}`"));
            let hint = format!("write `{name}'(t) = …` for a state, `{name}(t) = …` for an output");
            return Err(problem.hint(hint));
        }
        self.expect("=")?;
        Ok((left, self.expression()?))
    }
}
