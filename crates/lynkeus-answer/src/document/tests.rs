use super::*;

/// A document with one of everything.
fn sample() -> Document {
    let mut document = Document::new(Line::from("Tank: ").decided("proved").and(" <here>"));
    document.line("measured: level");
    document.part().line("seen: a & b").item("of its own");
    document.heading(Line::from("theorem: ").decided("refuted"));
    let condition = |verdict, witness: Option<&str>| Condition {
        verdict,
        statement: "it holds".to_owned(),
        detail: "found".to_owned(),
        witness: witness.map(str::to_owned),
    };
    let conditions = [
        condition("proved", None),
        condition("refuted", Some("at x")),
    ];
    document.conditions(conditions, "conditions");
    let constant = |name: &str, value: &str| {
        vec![
            Cell::from(name),
            Cell::Number(value.to_owned()),
            Cell::from("a rate"),
        ]
    };
    let constants = Table::plain(["constant", "value", "meaning"]);
    document.table(constants.with([constant("c", "0.25"), constant("long", "3")]));
    document.notes(["only inside"]);
    document.folded("more").code("[observer]\ntheta = 1\n");
    document
}

#[test]
fn a_text_is_what_a_terminal_shows() {
    assert_eq!(
        sample().to_text(),
        "Tank: proved <here>
measured: level

seen: a & b
  of its own

theorem: refuted
  proved     it holds: found
  refuted    it holds: found
             at x
  c     0.25  a rate
  long     3  a rate
  note: only inside

more
[observer]
theta = 1
"
    );
}

#[test]
fn html_has_the_same_and_no_markup_of_others() {
    let html = sample().to_html();
    assert!(html.contains("<p>seen: a &amp; b</p>") && html.contains("&lt;here&gt;"));
    assert!(
        html.contains(
            "<th scope=\"col\" style=\"text-align:left;vertical-align:top\">constant</th>"
        )
    );
    assert!(html.contains("--no,#b91c1c);font-weight:600\">refuted</span>"));
    assert!(html.contains("<details><summary>more</summary>\n<pre>[observer]"));
    assert!(html.contains(">found; at x</td>"));
    let hostile = "</p><script>alert(\"1\" & '2')</script>\u{202e}";
    assert_eq!(
        Document::new(hostile).to_html(),
        "<p><b>&lt;/p&gt;&lt;script&gt;alert(&quot;1&quot; &amp; &#39;2&#39;)&lt;/script&gt;\\u{202e}</b></p>\n"
    );
    assert_eq!(Document::new("\u{1b}[31m").to_text(), "\\u{1b}[31m\n");
}

/// Where many are proved, a text counts them; HTML lists them all.
#[test]
fn many_proofs_are_a_count() {
    let proved = Condition {
        verdict: "proved",
        statement: "s".to_owned(),
        detail: "d".to_owned(),
        witness: None,
    };
    let mut document = Document::default();
    document.conditions(vec![proved; 13], "hypotheses");
    assert_eq!(document.to_text(), "  proved     13 hypotheses\n");
    assert_eq!(document.to_html().matches("<td").count(), 3 * 13);
}

#[test]
fn columns_are_as_wide_as_they_need() {
    let number = |x: &str| Cell::Number(x.to_owned());
    let table = Table::new(["family", "peak", "unit", "remark"]).with([
        vec![
            Cell::from("ekf"),
            number("0.1"),
            Cell::Missing,
            Cell::from(""),
        ],
        vec![
            Cell::from("triangular"),
            number("12"),
            Cell::Missing,
            Cell::from("the knee"),
        ],
        vec!["mhe".into(), "it cannot run on these samples".into()],
    ]);
    let mut document = Document::default();
    document.table(table.dense().at_most(2, "more"));
    assert_eq!(
        document.to_text(),
        "family      peak  remark
ekf          0.1
triangular    12  the knee
and 1 more
"
    );
    assert!(document.to_html().contains("<td colspan=\"2\" style"));
}
