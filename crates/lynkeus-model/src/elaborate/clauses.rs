//! What the text says of events, as it is noted on the way.

use std::collections::HashMap;

use lynkeus_expr::Node;

use crate::diagnostic::Span;
use crate::plant::Timer;

/// What has a symbol of its own because of events.
#[derive(Debug, Default)]
pub(crate) struct EventSymbols {
    /// variables with the symbols of their values before an event, and where these are first asked for
    pub before: HashMap<Node, (Node, Span)>,
    pub timers: Vec<Timer>,
}

/// A variable that gets a value at an event, the value, and where that stands.
pub(crate) type Change = (Node, Node, Span);

/// A `when` or an `elsewhen`, written out; without conditions, an equation that holds at every event.
#[derive(Debug)]
pub(crate) struct FlatClause {
    /// the same number for all of one `when`
    pub group: usize,
    pub conditions: Vec<Node>,
    /// of discrete variables
    pub assigned: Vec<Change>,
    /// of states
    pub resets: Vec<Change>,
    pub span: Span,
}
