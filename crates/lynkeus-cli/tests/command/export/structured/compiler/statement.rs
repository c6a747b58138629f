//! Statements.

use tree_sitter::Node;

use super::{Compiler, Kind, children};

impl Compiler<'_> {
    pub(super) fn statements(&mut self, nodes: &[Node<'_>]) {
        for node in nodes {
            self.statement(*node);
        }
    }

    fn condition(&mut self, node: Node<'_>) -> String {
        let value = self.value(node);
        assert_eq!(value.kind, Kind::Bool, "{}", &self.text[node.byte_range()]);
        value.text
    }

    pub(super) fn place(&mut self, node: Node<'_>) -> String {
        let value = self.value(node);
        assert_eq!(value.kind, Kind::Dint, "{}", &self.text[node.byte_range()]);
        value.text
    }

    fn statement(&mut self, node: Node<'_>) {
        let parts = children(node);
        match node.kind() {
            "assignment_statement" => {
                let (target, value) = (self.value(parts[0]), self.value(parts[2]));
                let is_literal =
                    value.kind == Kind::AnyReal && [Kind::Real, Kind::Lreal].contains(&target.kind);
                let told = &self.text[node.byte_range()];
                assert!(is_literal || target.kind == value.kind, "{told}");
                let cast = match target.kind {
                    Kind::Real => "(float)",
                    _ => "",
                };
                let line = format!("{} = {cast}({});", target.text, value.text);
                self.line(&line);
            }
            "if_statement" => self.conditional(&parts),
            "for_statement" => self.range(&parts),
            "while_statement" => {
                let condition = self.condition(parts[1]);
                self.line(&format!("while ({condition}) {{"));
                self.statements(&parts[3..]);
                self.line("}");
            }
            "exit_statement" => self.line("break;"),
            "return_statement" => self.line("goto end;"),
            "empty_statement" => {}
            kind if kind.ends_with("_statement") => panic!("{}", &self.text[node.byte_range()]),
            // words and declarations
            _ => {}
        }
    }

    fn conditional(&mut self, parts: &[Node<'_>]) {
        let condition = self.condition(parts[1]);
        self.line(&format!("if ({condition}) {{"));
        for part in &parts[2..] {
            let inner = children(*part);
            match part.kind() {
                "elsif_clause" => {
                    let condition = self.condition(inner[1]);
                    self.line(&format!("}} else if ({condition}) {{"));
                    self.statements(&inner[2..]);
                }
                "else_clause" => {
                    self.line("} else {");
                    self.statements(&inner);
                }
                _ => self.statement(*part),
            }
        }
        self.line("}");
    }

    /// Its ends are looked at once.
    fn range(&mut self, parts: &[Node<'_>]) {
        let name = self.place(parts[1]);
        let (from, to) = (self.place(parts[3]), self.place(parts[5]));
        let is_down = parts[6].kind() == "BY";
        if is_down {
            assert_eq!(self.word(parts[7]), "-1");
        }
        let (relation, step) = if is_down { (">=", "--") } else { ("<=", "++") };
        let head = format!(
            "{{ const int32_t last = {to};\nfor ({name} = {from}; {name} {relation} last; {name}{step}) {{"
        );
        self.line(&head);
        self.statements(&parts[6..]);
        self.line("} }");
    }
}
