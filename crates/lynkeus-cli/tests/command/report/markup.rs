//! What a page is made of: nothing in it is fetched, and no name becomes markup.

use super::browser::{browsed, sound};
use super::{data, node, page, unproved};
use crate::Folder;
use crate::export::has;

/// Tags open and close one within the other; gives their names.
fn tags(html: &str) -> Vec<String> {
    let mut open: Vec<String> = vec![];
    let mut all = vec![];
    for piece in html.split('<').skip(1) {
        let (tag, _) = piece.split_once('>').expect("a tag that ends");
        let name: String = tag.chars().take_while(|c| c.is_alphanumeric()).collect();
        match tag.strip_prefix('/') {
            Some(name) => assert_eq!(open.pop().as_deref(), Some(name), "{piece}"),
            None if ["meta", "link", "!DOCTYPE html"]
                .iter()
                .any(|v| tag.starts_with(v)) => {}
            None => open.push(name.clone()),
        }
        all.push(name);
    }
    assert_eq!(open, Vec::<String>::new());
    all
}

/// The markup of a page, what its scripts and styles hold left out.
pub(crate) fn markup(page: &str) -> String {
    let mut rest = page;
    let mut out = String::new();
    while let Some(at) = ["<script", "<style"]
        .iter()
        .filter_map(|t| rest.find(t))
        .min()
    {
        let (before, from) = rest.split_at(at);
        let end = if from.starts_with("<script") {
            "</script>"
        } else {
            "</style>"
        };
        let inside = from.find('>').unwrap() + 1;
        let over = from.find(end).unwrap();
        out += &format!("{before}{}{end}", &from[..inside]);
        rest = &from[over + end.len()..];
    }
    out + rest
}

fn asks_for_nothing(page: &str) {
    let markup = markup(page);
    tags(&markup);
    assert!(markup.contains("content=\"default-src 'none';"), "{markup}");
    for word in [
        " src=", "srcset", "@import", "url(", "<iframe", "<object", "<form", "http:", "https:",
    ] {
        assert!(!markup.contains(word), "{word}");
    }
    assert_eq!(markup.matches(" href=").count(), 1);
    assert!(markup.contains("<link rel=\"icon\" href=\"data:,\">"));
    for word in [
        "fetch(",
        "import(",
        "XMLHttpRequest",
        "WebSocket",
        "EventSource",
        "sendBeacon",
        "@import",
        "url(",
        "src=",
    ] {
        assert!(!page.contains(word), "{word}");
    }
}

#[test]
fn a_page_is_one_file_with_what_the_commands_say() {
    let folder = Folder::new();
    let own = page(&folder, &["study.toml"]);
    asks_for_nothing(&own);
    let made = folder.run(&["export", "study.toml", "--to", "html", "-o", "page"]);
    assert_eq!(made.code, 0, "{}", made.err);
    assert_eq!(folder.read("page/twotanks.html"), own);
    let text = own.replace("&#39;", "'");
    for said in [
        "steps from sample to sample",
        "Permission is hereby granted",
    ] {
        assert!(text.contains(said), "{said}");
    }
    // what certify says first stands at the top
    let certified = folder.run(&["certify", "study.toml"]);
    let word = certified.out.split(", ").nth(1).unwrap();
    let word = word.split(':').next().unwrap();
    let (_, shown) = own
        .split_once("Convergence: <span class=\"verdict\"")
        .unwrap();
    let (_, shown) = shown.split_once('>').unwrap();
    assert!(shown.starts_with(&format!("{word}</span>")), "{word}");
    // on a log nothing is simulated, and nothing is known to be true but what the log says
    let on_log = page(&folder, &["study.toml", "log.csv"]);
    assert!(on_log.contains("of the log log.csv."));
    assert!(data(&on_log)["quantities"][1]["truth"].is_null());
}

/// Names that are markup wherever they are not escaped.
fn hostile() -> Folder {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        r#"model '</script><script>alert(1)</script>'
  Real '<img src=//x.invalid onerror=alert(2)>'(start = 1, min = -2, max = 2, unit = "</title>") "<!--<script>alert(4)</script>";
  Real 'b";alert(5);//'(start = 0, min = -2, max = 2);
  output Real '*/</style><b>`${alert(6)}' = '<img src=//x.invalid onerror=alert(2)>';
equation
  der('<img src=//x.invalid onerror=alert(2)>') = 'b";alert(5);//';
  der('b";alert(5);//') = -'<img src=//x.invalid onerror=alert(2)>';
end '</script><script>alert(1)</script>';
"#,
    );
    folder.write(
        "study.toml",
        "plant = \"m.mo\"\nsensors = { noise = { \"*/</style><b>`${alert(6)}\" = 0.01 } }\nobserver = { family = \"triangular\", theta = 2 }\n\
         [simulate]\nuntil = 10\noutput_step = 0.1\n[plot]\ntime_unit = \"</script><i>s\"\n",
    );
    folder
}

#[test]
fn names_do_not_break_a_page() {
    let (folder, plain) = (hostile(), unproved());
    let page_text = page(&folder, &["study.toml"]);
    let own = markup(&page_text);
    let all = tags(&own);
    let count = |all: &[String], tag: &str| all.iter().filter(|t| *t == tag).count();
    let expected = tags(&markup(&page(&plain, &["study.toml"])));
    for tag in ["script", "style", "title", "img", "b", "i", "body"] {
        assert_eq!(count(&all, tag), count(&expected, tag), "{tag}");
    }
    if has("node") {
        let run = node(&folder, None);
        assert_eq!((run.0.len(), run.1.len(), run.2), (3, 101, true));
    }
    let Some(seen) = browsed(&folder) else { return };
    assert_eq!(
        seen["title"],
        "</script><script>alert(1)</script>: what is estimated"
    );
    sound(&seen);
}

/// A page goes to others: it names files, no folder of this machine.
#[test]
fn no_folder_is_told() {
    let folder = unproved();
    let place = folder.path.path().to_str().unwrap().to_owned();
    let text = folder.read("two_tanks.mo");
    let unread = "  parameter Real unread = 1;\n  input";
    folder.write("two_tanks.mo", &text.replacen("  input", unread, 1));
    let short: Vec<String> = folder
        .read("log.csv")
        .lines()
        .take(30)
        .map(str::to_owned)
        .collect();
    folder.write("log.csv", &(short.join("\n") + "\n"));
    let [study, log] = ["study.toml", "log.csv"].map(|file| format!("{place}/{file}"));
    let told = page(&folder, &[&study, &log]);
    assert!(told.contains("lynkeus tune study.toml --plot"));
    assert!(told.contains("It cannot be told: "));
    assert!(!told.contains(&place));
}
