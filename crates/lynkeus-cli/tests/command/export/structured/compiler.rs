//! Structured Text as C, for a small part of IEC 61131-3 and strictly: no conversion that is not asked for, no
//! condition that is not evaluated, no place beyond an array, what is shared is handed over with its own type.

mod statement;
mod value;

use std::collections::HashMap;
use std::fmt::Write as _;

use tree_sitter::{Node, Parser};

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Bool,
    Dint,
    Real,
    Lreal,
    /// a literal, which is both
    AnyReal,
    /// an array or a structure
    Named(String),
}

#[derive(Clone, Debug)]
enum Composed {
    Array(i64, Kind),
    Structure(Vec<(String, Kind)>),
}

#[derive(Clone, Debug)]
struct Variable {
    name: String,
    kind: Kind,
    /// VAR_IN_OUT
    is_shared: bool,
    start: Option<String>,
}

#[derive(Clone, Debug)]
struct Function {
    returns: Kind,
    parameters: Vec<Variable>,
}

/// A value in C.
struct Value {
    text: String,
    kind: Kind,
}

struct Compiler<'t> {
    text: &'t str,
    types: HashMap<String, Composed>,
    functions: HashMap<String, Function>,
    /// of the function under way
    variables: Vec<Variable>,
    /// its name
    name: String,
    c: String,
}

const HEAD: &str = "#include <math.h>\n#include <stdint.h>\n#include <stdio.h>\n#include <stdlib.h>\n#include <string.h>\n\
static int32_t at(int32_t place, int32_t count)\n{\n    if (place < 0 || place >= count) {\n        \
fprintf(stderr, \"place %d of %d\\n\", (int)place, (int)count);\n        exit(2);\n    }\n    return place;\n}\n";

/// The program in C, with its function block as `block`, and what gives it signals and tells its estimates.
pub(super) fn compiled(text: &str) -> String {
    let mut parser = Parser::new();
    let language = tree_sitter_iec61131_3_st::LANGUAGE.into();
    parser.set_language(&language).unwrap();
    let tree = parser.parse(text, None).unwrap();
    let mut compiler = Compiler {
        text,
        types: HashMap::new(),
        functions: HashMap::new(),
        variables: vec![],
        name: String::new(),
        c: HEAD.to_owned(),
    };
    for item in children(tree.root_node()) {
        compiler.item(item);
    }
    compiler.c
}

/// What has a meaning.
fn children(node: Node<'_>) -> Vec<Node<'_>> {
    let mut cursor = node.walk();
    let all: Vec<Node<'_>> = node.children(&mut cursor).collect();
    all.into_iter().filter(|child| !child.is_extra()).collect()
}

fn of_kind<'t>(node: Node<'t>, kind: &str) -> Vec<Node<'t>> {
    children(node)
        .into_iter()
        .filter(|child| child.kind() == kind)
        .collect()
}

fn c_kind(kind: &Kind) -> String {
    match kind {
        Kind::Bool | Kind::Dint => "int32_t".to_owned(),
        Kind::Real => "float".to_owned(),
        Kind::Lreal | Kind::AnyReal => "double".to_owned(),
        Kind::Named(name) => format!("t_{name}"),
    }
}

impl<'t> Compiler<'t> {
    fn word(&self, node: Node<'_>) -> String {
        self.text[node.byte_range()].to_ascii_lowercase()
    }

    fn name_of(&self, node: Node<'_>) -> String {
        self.word(of_kind(node, "identifier")[0])
    }

    fn line(&mut self, text: &str) {
        writeln!(self.c, "{text}").unwrap();
    }

    fn item(&mut self, node: Node<'_>) {
        match node.kind() {
            "type_declaration" => {
                let made = of_kind(node, "type_definition");
                made.into_iter().for_each(|made| self.type_definition(made));
            }
            "function_declaration" => self.function(node),
            "function_block_declaration" => self.block(node),
            // its call of the block is looked at
            "program_declaration" => {
                self.variables = self.declared(node);
                let calls = of_kind(node, "invocation_statement");
                assert_eq!(calls.len(), 1);
                let call = children(calls[0])[0];
                for argument in of_kind(of_kind(call, "argument_list")[0], "named_argument") {
                    let name = self.name_of(argument);
                    let given = children(argument)[2];
                    let kind = self.value(given).kind;
                    let block = &self.functions["block"];
                    let parameter = block.parameters.iter().find(|p| p.name == name);
                    assert_eq!(parameter.unwrap().kind, kind);
                }
            }
            other => panic!("{other}: {}", &self.text[node.byte_range()]),
        }
    }

    fn kind(&self, node: Node<'_>) -> Kind {
        match self.word(node).as_str() {
            "bool" => Kind::Bool,
            "dint" => Kind::Dint,
            "real" => Kind::Real,
            "lreal" => Kind::Lreal,
            name => {
                let is_known = self.types.contains_key(name) || name == "block";
                assert!(is_known || self.functions.contains_key(name), "type {name}");
                Kind::Named(name.to_owned())
            }
        }
    }

    /// The type of a declaration, which stands after its colon; one without a name gets one.
    fn declared_kind(&mut self, declaration: Node<'_>) -> Kind {
        let parts = children(declaration);
        let colon = parts.iter().position(|part| part.kind() == ":").unwrap();
        let kind = parts[colon + 1];
        if kind.kind() != "array_type" {
            return self.kind(kind);
        }
        let name = format!("anonymous_{}", self.types.len());
        self.array(&name, kind);
        Kind::Named(name)
    }

    fn array(&mut self, name: &str, node: Node<'_>) {
        let ends = of_kind(of_kind(node, "subrange")[0], "integer_literal");
        assert_eq!(self.word(ends[0]), "0");
        let count = self.word(ends[1]).parse::<i64>().unwrap() + 1;
        assert!(count > 0);
        let entry = self.kind(*children(node).last().unwrap());
        self.compose(name, Composed::Array(count, entry));
    }

    fn compose(&mut self, name: &str, composed: Composed) {
        let fields = match &composed {
            Composed::Array(count, kind) => format!("{} e[{count}];", c_kind(kind)),
            Composed::Structure(fields) => fields
                .iter()
                .map(|(name, kind)| format!("{} v_{name};", c_kind(kind)))
                .collect(),
        };
        // functions stand after it, whatever is under way
        let line = format!("typedef struct {{ {fields} }} t_{name};\n");
        match self.c.rfind("//FUNCTION\n") {
            Some(place) if !self.name.is_empty() => self.c.insert_str(place, &line),
            _ => self.c += &line,
        }
        assert!(
            self.types.insert(name.to_owned(), composed).is_none(),
            "{name}"
        );
    }

    fn type_definition(&mut self, node: Node<'_>) {
        let name = self.name_of(node);
        if let [array] = of_kind(node, "array_type")[..] {
            return self.array(&name, array);
        }
        let structure = of_kind(node, "structure_type_inline")[0];
        let mut fields = vec![];
        for field in of_kind(structure, "structure_field") {
            let kind = self.declared_kind(field);
            fields.push((self.name_of(field), kind));
        }
        self.compose(&name, Composed::Structure(fields));
    }

    /// The variables of a function, a block or a program.
    fn declared(&mut self, node: Node<'_>) -> Vec<Variable> {
        let mut variables: Vec<Variable> = vec![];
        for section in children(node) {
            if !["var_input", "var_in_out", "var_output", "var_block"].contains(&section.kind()) {
                continue;
            }
            for declaration in of_kind(section, "variable_declaration") {
                let kind = self.declared_kind(declaration);
                let name = self.name_of(declaration);
                assert!(
                    variables.iter().all(|known| known.name != name),
                    "twice: {name}"
                );
                assert!(!self.types.contains_key(&name), "a type, too: {name}");
                assert!(
                    !self.functions.contains_key(&name),
                    "a function, too: {name}"
                );
                variables.push(Variable {
                    name,
                    start: self.start(declaration, &kind),
                    kind,
                    is_shared: section.kind() == "var_in_out",
                });
            }
        }
        variables
    }

    /// What a variable is at the start.
    fn start(&mut self, declaration: Node<'_>, kind: &Kind) -> Option<String> {
        let parts = children(declaration);
        let place = parts.iter().position(|part| part.kind() == ":=")?;
        let given: Vec<Node<'_>> = parts[place + 1..].to_vec();
        let literals = given.iter().filter(|part| part.is_named());
        for literal in literals.clone() {
            let kinds = ["integer_literal", "real_literal", "boolean_literal"];
            let told = &self.text[declaration.byte_range()];
            assert!(kinds.contains(&literal.kind()), "{told}");
        }
        let texts: Vec<String> = literals.map(|part| self.value(*part).text).collect();
        match kind {
            Kind::Named(name) => {
                let Composed::Array(count, _) = &self.types[name] else {
                    panic!("{name}");
                };
                assert_eq!(texts.len() as i64, *count);
                Some(format!("{{{{{}}}}}", texts.join(", ")))
            }
            _ => Some(texts[0].clone()),
        }
    }

    fn function(&mut self, node: Node<'_>) {
        let parts = children(node);
        let colon = parts.iter().position(|part| part.kind() == ":").unwrap();
        let returns = self.kind(parts[colon + 1]);
        self.name = self.name_of(node);
        self.line("//FUNCTION");
        let variables = self.declared(node);
        let count = parts
            .iter()
            .filter(|part| ["var_input", "var_in_out"].contains(&part.kind()))
            .map(|part| of_kind(*part, "variable_declaration").len())
            .sum();
        // inputs and what is shared stand before what is a function's own
        let parameters = variables[..count].to_vec();
        assert!(!parameters.is_empty(), "{}: no parameter", self.name);
        let texts = parameters.iter().map(|parameter| {
            let star = if parameter.is_shared { "*" } else { "" };
            format!("{} {star}v_{}", c_kind(&parameter.kind), parameter.name)
        });
        let head = format!(
            "static {} f_{}({})\n{{\n{} v_{} = 0;",
            c_kind(&returns),
            self.name,
            texts.collect::<Vec<_>>().join(", "),
            c_kind(&returns),
            self.name
        );
        self.line(&head);
        for own in &variables[count..] {
            let start = own.start.clone().unwrap_or_else(|| match own.kind {
                Kind::Named(_) => "{{0}}".to_owned(),
                _ => "0".to_owned(),
            });
            let line = format!("{} v_{} = {start};", c_kind(&own.kind), own.name);
            self.line(&line);
        }
        self.variables = variables;
        self.variables.push(Variable {
            name: self.name.clone(),
            kind: returns.clone(),
            is_shared: false,
            start: None,
        });
        self.statements(&children(node));
        let end = format!("end: return v_{};\n}}", self.name);
        self.line(&end);
        let name = std::mem::take(&mut self.name);
        let known = self.functions.insert(
            name,
            Function {
                returns,
                parameters,
            },
        );
        assert!(known.is_none());
    }

    /// The variables of the block are those of its only instance.
    fn block(&mut self, node: Node<'_>) {
        let variables = self.declared(node);
        let fields: String = variables
            .iter()
            .map(|own| format!("{} v_{};", c_kind(&own.kind), own.name))
            .collect();
        let starts: String = variables
            .iter()
            .filter_map(|own| Some(format!(".v_{} = {},", own.name, own.start.as_ref()?)))
            .collect();
        let head = format!(
            "static struct t_block {{ {fields} }} it = {{ {starts} }};\n\
             static void block(struct t_block *it)\n{{"
        );
        self.line(&head);
        let shared = |own: &Variable| Variable {
            is_shared: true,
            ..own.clone()
        };
        // a field of the instance is reached by its name
        for own in &variables {
            let line = format!("{} *v_{1} = &it->v_{1};", c_kind(&own.kind), own.name);
            self.line(&line);
        }
        self.variables = variables.iter().map(shared).collect();
        self.statements(&children(node));
        self.line("}");
        self.ends(&variables, node);
        let name = self.name_of(node);
        let block = Function {
            returns: Kind::Bool,
            parameters: variables,
        };
        self.functions.insert(name, block.clone());
        self.functions.insert("block".to_owned(), block);
    }

    /// What gives the block a row of numbers, and what tells its estimates.
    fn ends(&mut self, variables: &[Variable], node: Node<'_>) {
        let (mut give, mut tell) = (String::new(), String::new());
        let mut count = 0;
        for own in variables {
            if let Some(signal) = own.name.strip_suffix("_valid") {
                count += 1;
                write!(give, "it.v_{signal}_valid = !isnan(cells[{count}]);").unwrap();
                write!(
                    give,
                    "it.v_{signal} = (REAL)(it.v_{signal}_valid ? cells[{count}] : 0.0);"
                )
                .unwrap();
            }
        }
        let outputs = of_kind(of_kind(node, "var_output")[0], "variable_declaration");
        for output in outputs {
            let name = self.name_of(output);
            if !["code", "credible"].contains(&name.as_str()) && !name.ends_with("_reading") {
                write!(tell, "printf(\",%.17g\", (double)it.v_{name});").unwrap();
            }
        }
        let real = variables.iter().find(|own| own.kind == Kind::Real);
        let real = if real.is_some() { "float" } else { "double" };
        let text = format!(
            "#define SIGNALS {count}\n#define REAL {real}\n\
             static void give(const double *cells)\n{{ it.v_t = cells[0]; {give} }}\n\
             static void tell(double t)\n{{ printf(\"%.17g\", t); {tell} printf(\"\\n\"); }}"
        );
        self.line(&text);
    }
}
