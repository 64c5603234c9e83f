//! The crane's name has no effect on the generated code.

use hydroboom_description::Description;
use hydroboom_export::c::{Precision, files};
use hydroboom_export::fmi::{Version, unit};
use hydroboom_export::structured_text::{Kind, plcopen, twincat, units};
use hydroboom_export::{blocks, controller, simulation_feedforward};
use proptest::prelude::*;
use std::sync::LazyLock;

/// A text without its comments between two delimiters; `None` if a comment is not closed.
fn without_comments(text: &str, open: &str, close: &str) -> Option<String> {
    let mut rest = text;
    let mut code = String::new();
    while let Some(at) = rest.find(open) {
        code += &rest[..at];
        let after = &rest[at + open.len()..];
        rest = &after[after.find(close)? + close.len()..];
    }
    (!rest.contains(close)).then(|| code + rest)
}

fn code_in_c(description: &Description) -> String {
    let [hydraulics, boom] = blocks(description).unwrap();
    let made =
        files(&[hydraulics, boom, controller(description).unwrap()], "crane", Precision::Double)
            .unwrap();
    assert!(made.header.is_ascii() && made.source.is_ascii());
    let of = |text: &str| without_comments(text, "/*", "*/").unwrap();
    of(&made.header) + &of(&made.source)
}

fn code_in_text(description: &Description) -> Vec<String> {
    let units = units(description).unwrap();
    assert!(roxmltree::Document::parse(&plcopen::project(&units)).is_ok());
    let of = |unit: &hydroboom_export::structured_text::Unit| {
        let text = unit.text();
        assert!(text.is_ascii());
        if unit.kind != Kind::Globals {
            // a parser that knows no literals with a type
            iecst::parse_pou(&text.replace("LREAL#", "")).unwrap();
        }
        assert!(roxmltree::Document::parse(&twincat::file(unit).1).is_ok());
        without_comments(&text, "(*", "*)").unwrap()
    };
    units.iter().map(of).collect()
}

/// The sources of an FMU, after a check that its description is well-formed.
fn sources(description: &Description) -> String {
    let mut all = String::new();
    for version in [Version::Two, Version::Three] {
        for block in
            [controller(description).unwrap(), simulation_feedforward(description).unwrap()]
        {
            let made = unit(&block, None, description, version).unwrap();
            assert!(roxmltree::Document::parse(&made.files[0].1).is_ok(), "{}", made.files[0].1);
            let files = made.files.iter().filter(|(path, _)| path.ends_with(".c"));
            all.extend(files.map(|(_, text)| without_comments(text, "/*", "*/").unwrap()));
        }
    }
    all
}

fn named(name: &str) -> Description {
    let mut crane = Description::uia_single_boom().unwrap();
    crane.name = name.into();
    crane
}

static USUAL: LazyLock<(String, Vec<String>, String)> = LazyLock::new(|| {
    let crane = named("crane");
    (code_in_c(&crane), code_in_text(&crane), sources(&crane))
});

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn random_names_do_not_alter_the_code(name in any::<String>()) {
        let crane = named(&name);
        prop_assert_eq!(&code_in_c(&crane), &USUAL.0);
        prop_assert_eq!(&code_in_text(&crane), &USUAL.1);
        prop_assert_eq!(&sources(&crane), &USUAL.2);
    }
}

#[test]
fn names_made_for_code_injection_do_not_alter_the_code() {
    for name in [
        "*/ int evil(void); /*",
        "*) END_VAR evil := TRUE; (*",
        "]]></Declaration><evil/>",
        "a\nb\r\nc\u{2028}d",
        "\\\n*/",
        "??/\n*/ #include <evil.h>",
        "(* (* /* /* // \" ' {attribute 'evil'}",
        "",
        "IF THEN END_IF while for",
    ] {
        let crane = named(name);
        assert_eq!(code_in_c(&crane), USUAL.0, "{name:?}");
        assert_eq!(code_in_text(&crane), USUAL.1, "{name:?}");
        assert_eq!(sources(&crane), USUAL.2, "{name:?}");
    }
}
