//! Texts to plants: the languages told apart by the ends of file names, files, single expressions.

use std::path::Path;

use lynkeus_expr::{Graph, Node};

use crate::diagnostic::Problem;
use crate::limits::MAX_SOURCE_BYTES;
use crate::syntax::parse_single_expression;
use crate::{Diagnostic, LoadError, LoadOptions, Plant, elaborate, ode_model};

impl Plant {
    /// Reads a Modelica text. `file_name` is what diagnostics call it.
    ///
    /// # Errors
    /// The first thing in the text that is wrong or not supported.
    ///
    /// ```
    /// use lynkeus_model::{LoadOptions, Plant};
    ///
    /// let text = "model Tank
    ///   input Real inflow;
    ///   Real level(start = 4, min = 0);
    /// equation
    ///   2*der(level) = inflow - sqrt(level);
    /// end Tank;";
    /// let plant = Plant::from_modelica(text, "tank.mo", &LoadOptions::default())?;
    /// assert_eq!(plant.states[0].name, "level");
    /// assert_eq!(plant.states[0].start, Some(4.0));
    /// # Ok::<(), lynkeus_model::Diagnostic>(())
    /// ```
    pub fn from_modelica(
        source: &str,
        file_name: &str,
        options: &LoadOptions,
    ) -> Result<Self, Diagnostic> {
        let (mut plant, warnings) = elaborate::plant(source, options)
            .map_err(|problem| Diagnostic::new(problem, file_name, source))?;
        let warnings = warnings.into_iter();
        plant.warnings = warnings
            .map(|problem| Diagnostic::warning(problem, file_name, source))
            .collect();
        Ok(plant)
    }

    /// Reads a text in the notation of `@ODEmodel`, as StructuralIdentifiability.jl has it.
    /// `file_name` is what diagnostics call it; its stem is the name of a model without one.
    ///
    /// # Errors
    /// The first thing in the model that is wrong or not supported.
    ///
    /// ```
    /// use lynkeus_model::{LoadOptions, Plant};
    ///
    /// let text = "decay = @ODEmodel(
    ///     x'(t) = -k*x(t) + u(t),
    ///     y(t) = x(t)/2
    /// )";
    /// let symbolic = LoadOptions { symbolic_parameters: true, ..LoadOptions::default() };
    /// let plant = Plant::from_ode_model(text, "decay.jl", &symbolic)?;
    /// assert_eq!(plant.name, "decay");
    /// assert_eq!((plant.states[0].name.as_str(), plant.inputs[0].name.as_str()), ("x", "u"));
    /// assert_eq!(plant.parameters[0].variable.name, "k");
    /// # Ok::<(), lynkeus_model::Diagnostic>(())
    /// ```
    pub fn from_ode_model(
        source: &str,
        file_name: &str,
        options: &LoadOptions,
    ) -> Result<Self, Diagnostic> {
        ode_model::plant(source, file_name, options)
            .map_err(|problem| Diagnostic::new(problem, file_name, source))
    }

    /// Reads a file: the notation of `@ODEmodel` where its name ends in `.jl`, else Modelica.
    ///
    /// # Errors
    /// The file cannot be read, is not UTF-8, is larger than 64 MiB, or its text is refused.
    pub fn load(path: &Path, options: &LoadOptions) -> Result<Self, LoadError> {
        let read_error = |source| LoadError::Read {
            path: path.to_owned(),
            source,
        };
        let bytes = std::fs::metadata(path).map_err(read_error)?.len();
        let limit = MAX_SOURCE_BYTES as u64;
        if bytes > limit {
            return Err(LoadError::TooLarge {
                path: path.to_owned(),
                bytes,
                limit,
            });
        }
        let bytes = std::fs::read(path).map_err(read_error)?;
        let source = std::str::from_utf8(&bytes).map_err(|error| {
            let offset = error.valid_up_to();
            let before = bytes.iter().take(offset);
            let line = 1 + before.filter(|&&byte| byte == b'\n').count();
            LoadError::NotUtf8 {
                path: path.to_owned(),
                line,
                offset,
            }
        })?;
        let name = path.display().to_string();
        Ok(Self::from_text(source, &name, options)?)
    }

    /// Reads a text in the language that `file_name` tells: the notation of `@ODEmodel` where it
    /// ends in `.jl`, else Modelica.
    ///
    /// # Errors
    /// The first thing in the text that is wrong or not supported.
    pub fn from_text(
        source: &str,
        file_name: &str,
        options: &LoadOptions,
    ) -> Result<Self, Diagnostic> {
        match is_ode_model(file_name) {
            false => Self::from_modelica(source, file_name, options),
            true => Self::from_ode_model(source, file_name, options),
        }
    }
}

/// Whether a file holds the notation of `@ODEmodel`: its name ends in `.jl`.
fn is_ode_model(file_name: &str) -> bool {
    let extension = Path::new(file_name).extension();
    extension.is_some_and(|end| end.eq_ignore_ascii_case("jl"))
}

/// The names of the models of a text, in its order. The text is taken as an `@ODEmodel` text
/// where `file_name` ends in `.jl`, else as Modelica.
///
/// # Errors
/// The text cannot be read so far that its models are known.
///
/// ```
/// let text = "one = @ODEmodel(x'(t) = 1)  two = @ODEmodel(x'(t) = 2)";
/// assert_eq!(lynkeus_model::model_names(text, "models.jl")?, ["one", "two"]);
/// # Ok::<(), lynkeus_model::Diagnostic>(())
/// ```
pub fn model_names(source: &str, file_name: &str) -> Result<Vec<String>, Diagnostic> {
    let names = match is_ode_model(file_name) {
        false => elaborate::names(source),
        true => ode_model::models(source, file_name)
            .map(|models| models.iter().map(|(name, _)| (*name).to_owned()).collect()),
    };
    names.map_err(|problem| Diagnostic::new(problem, file_name, source))
}

/// Reads one Modelica expression, such as `if time < 20 then 0.75 else 0.38`.
///
/// `names` gives the meaning of names, also of subscripted ones such as `x[3]`. Where it does
/// not know them, `time` is the symbol `time` of the graph and `pi` is the number. Names with
/// other characters than ASCII letters, digits and `_` stand in single quotes: `2*'β'`.
///
/// The operators are those of Modelica. The functions are `sqrt exp log log10 sin cos tan asin
/// acos atan atan2 sinh cosh tanh abs sign min max floor ceil integer mod rem div noEvent
/// smooth`, and for arrays `sum product min max size ndims zeros ones fill linspace identity
/// diagonal transpose cat scalar vector matrix array`.
///
/// # Errors
/// The text is not an expression, reads an unknown name, or is not a scalar number.
///
/// ```
/// use lynkeus_expr::{Graph, Tape};
///
/// let graph = Graph::new();
/// let feed = lynkeus_model::parse_expression(
///     "if time < 20 then 0.75 else 0.38*cos(pi)",
///     &graph,
///     &|_| None,
/// )?;
/// let time = graph.symbol("time").node();
/// let tape = Tape::new(&graph, &[time], &[feed]).unwrap();
/// let mut out = [0.0];
/// tape.evaluator().eval(&[30.0], &mut out);
/// assert_eq!(out, [-0.38]);
/// # Ok::<(), lynkeus_model::Diagnostic>(())
/// ```
pub fn parse_expression(
    source: &str,
    graph: &Graph,
    names: &dyn Fn(&str) -> Option<Node>,
) -> Result<Node, Diagnostic> {
    let refused = |problem| Diagnostic::new(problem, "expression", source);
    let (ast, root) = parse_single_expression(source).map_err(refused)?;
    let value = elaborate::evaluated(source, &ast, graph, names, |e| e.value(root));
    let scalar = value.map_err(refused)?.as_scalar();
    let node = scalar.and_then(|scalar| scalar.real(graph));
    let message = "expected a number, found an array or a condition";
    node.ok_or_else(|| refused(Problem::new(ast.expression(root).span, message)))
}
