//! Any text is an expression or a diagnostic within the text.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lynkeus_expr::Graph;
use lynkeus_model::parse_expression;

fuzz_target!(|text: &str| {
    let graph = Graph::new();
    let names = |name: &str| name.starts_with('x').then(|| graph.symbol(name).node());
    if let Err(refused) = parse_expression(text, &graph, &names) {
        assert!(refused.span.end as usize <= text.len());
        assert!(!refused.to_string().is_empty());
    }
});
