//! What shells and manuals are given of the command line.

use crate::Folder;

#[test]
fn every_command_has_a_manual_page_and_is_completed() {
    let folder = Folder::empty();
    let whole = folder.run(&["man"]);
    assert_eq!(whole.code, 0, "{}", whole.err);
    assert!(whole.out.contains(".TH lynkeus 1"), "{}", whole.out);
    let shells = ["bash", "zsh", "fish", "powershell", "elvish"];
    let scripts = shells.map(|shell| folder.run(&["completions", shell]).out);
    for command in [
        "check", "design", "certify", "simulate", "estimate", "fit", "tune", "compare", "export",
        "report", "serve", "schema",
    ] {
        let page = folder.run(&["man", command]).out;
        assert!(page.contains(&format!(".TH lynkeus-{command} 1")), "{page}");
        for (shell, script) in shells.iter().zip(&scripts) {
            assert!(script.contains(command), "{shell} does not know {command}");
        }
    }
    assert!(scripts.iter().all(|script| script.contains("memory-limit")));
}

#[test]
fn a_command_that_is_not_there_has_no_page() {
    let ended = Folder::empty().run(&["man", "estmate"]);
    assert_eq!(ended.code, 2);
    assert!(
        ended.err.contains("lynkeus has no command estmate"),
        "{}",
        ended.err
    );
    assert!(ended.err.contains("it has check, design"), "{}", ended.err);
}
