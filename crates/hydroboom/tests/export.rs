//! Model and controller as source code, as a user gets them.

#[path = "support/command.rs"]
mod command;

use command::{files, hydroboom, keys, parsed, says};

#[test]
fn what_is_exported_is_listed_and_comes_out_alike_each_time() {
    let path = files("export");
    for (target, first) in [("st", "FB_HydraulicModel.st"), ("c", "hydroboom.h")] {
        let (once, again) = (path(&format!("{target}-1")), path(&format!("{target}-2")));
        let found = parsed(&["export", target, "--out", &once, "--json"]);
        keys(&found["files"][0], &["file", "bytes", "sha256"]);
        keys(&found["flops"][0], &["entry", "flops"]);
        assert!(found["files"][0]["file"].as_str().is_some_and(|f| f.ends_with(first)), "{found}");
        assert!(hydroboom(&["export", target, "--out", &again]).status.success());
        for file in found["files"].as_array().unwrap() {
            let file = file["file"].as_str().unwrap();
            let other = file.replace(&once, &again);
            assert!(
                std::fs::read(file).unwrap() == std::fs::read(&other).unwrap(),
                "{file} differs"
            );
        }
    }
    let counts = parsed(&["export", "count", "--json"]);
    let of = |block: &str, call: &str| {
        let all = counts.as_array().unwrap();
        let found = all.iter().find(|c| c["block"] == block && c["call"] == call).unwrap();
        found["flops"].as_u64().unwrap()
    };
    // the step is that of both blocks, but for what the boom shows at its end
    assert!(of("model", "step") < of("hydraulic_model", "step") + of("flexible_boom", "step"));
    assert!(of("model", "step") > of("flexible_boom", "step"));
}

#[test]
fn what_a_language_cannot_say_is_refused_with_the_reason() {
    let path = files("export-refused");
    let out = path("out");
    says(&hydroboom(&["export", "c", "--out", &out, "--set", "boom.segments=10"]), "3 segments");
    let crane = path("lift.toml");
    assert!(hydroboom(&["new", &crane, "--circuit", "valve-controlled"]).status.success());
    says(&hydroboom(&["export", "st", "--crane", &crane, "--out", &out]), "self-contained");
    assert!(!std::path::Path::new(&out).exists(), "something was written");
    std::fs::write(&out, "in the way").unwrap();
    says(&hydroboom(&["export", "c", "--out", &out]), "cannot be made");
}
