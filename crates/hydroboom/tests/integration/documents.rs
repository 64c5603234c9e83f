//! The project's documents: links, index, length of lines.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Longest line of a page outside tables and code \[letters\].
const LINE: usize = 120;

/// Size of the first page: lines, and letters in a line.
const README: (usize, usize) = (130, 160);

/// Folder of the project.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every document by its path from the root, with its text.
pub fn documents() -> BTreeMap<String, String> {
    let mut found: Vec<String> =
        ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md"]
            .map(String::from)
            .into();
    let mut folders = vec!["docs".to_string()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(root().join(&folder)).unwrap() {
            let entry = entry.unwrap();
            let path = format!("{folder}/{}", entry.file_name().to_string_lossy());
            if entry.file_type().unwrap().is_dir() {
                folders.push(path);
            } else if path.ends_with(".md") {
                found.push(path);
            }
        }
    }
    let text = |path: String| {
        let text = fs::read_to_string(root().join(&path)).unwrap();
        (path, text)
    };
    found.into_iter().map(text).collect()
}

/// Text with the lines of fenced code left empty.
fn without_fences(text: &str) -> String {
    let mut fence: Option<&str> = None;
    let mut lines = Vec::new();
    for line in text.lines() {
        let start = line.trim_start();
        let mark = ["```", "~~~"].into_iter().find(|mark| start.starts_with(mark));
        match (fence, mark) {
            (None, Some(opens)) => fence = Some(opens),
            (Some(opened), Some(mark)) if opened == mark => fence = None,
            (None, None) => {
                lines.push(line);
                continue;
            }
            _ => {}
        }
        lines.push("");
    }
    lines.join("\n")
}

/// Text with code spans replaced by spaces; a span ends within its paragraph.
fn without_code_spans(text: &str) -> String {
    let paragraphs = text.split("\n\n").map(|paragraph| {
        let mut kept = String::new();
        let mut rest = paragraph;
        while let Some(at) = rest.find('`') {
            let marks = rest[at..].len() - rest[at..].trim_start_matches('`').len();
            let (before, from) = rest.split_at(at);
            let (mark, inside) = from.split_at(marks);
            kept += before;
            match end_of_span(inside, marks) {
                Some(end) => {
                    let hidden = |letter: char| if letter == '\n' { '\n' } else { ' ' };
                    kept.extend(inside[..end].chars().map(hidden));
                    rest = &inside[end + marks..];
                }
                None => {
                    kept += mark;
                    rest = inside;
                }
            }
        }
        kept + rest
    });
    paragraphs.collect::<Vec<_>>().join("\n\n")
}

/// Where a run of just so many backticks begins.
fn end_of_span(text: &str, marks: usize) -> Option<usize> {
    let mut at = 0;
    while let Some(next) = text[at..].find('`') {
        let start = at + next;
        let run = text[start..].len() - text[start..].trim_start_matches('`').len();
        if run == marks {
            return Some(start);
        }
        at = start + run;
    }
    None
}

/// Line, and the text of a link there.
type Place = (usize, String);

/// Targets of links and images in Markdown without code, each with its line, and labels that are not defined.
fn links(text: &str) -> (Vec<Place>, Vec<Place>) {
    let line = |at: usize| text[..at].matches('\n').count() + 1;
    let target = |text: &str| {
        let text = text.trim_start();
        match text.strip_prefix('<') {
            Some(rest) => rest.split('>').next().unwrap_or_default().to_string(),
            None => text.split_whitespace().next().unwrap_or_default().to_string(),
        }
    };
    let (mut targets, mut labels) = (Vec::new(), BTreeSet::new());
    for (at, _) in text.match_indices("](") {
        let rest = &text[at + 2..];
        let mut depth = 1;
        let end = rest.find(|letter: char| {
            depth += i32::from(letter == '(') - i32::from(letter == ')');
            depth == 0
        });
        targets.push((line(at), target(&rest[..end.unwrap_or(rest.len())])));
    }
    for (number, text) in text.lines().enumerate() {
        let definition = text.trim_start().strip_prefix('[').and_then(|rest| rest.split_once("]:"));
        if let Some((label, rest)) = definition.filter(|(label, _)| !label.contains(']')) {
            labels.insert(label.to_lowercase());
            targets.push((number + 1, target(rest)));
        }
        for mark in ["href=\"", "src=\""] {
            for (_, rest) in text.match_indices(mark).map(|(at, _)| text.split_at(at + mark.len()))
            {
                targets.push((number + 1, rest.split('"').next().unwrap_or_default().into()));
            }
        }
    }
    let used = text.match_indices("][").map(|(at, _)| {
        let label = text[at + 2..].split(']').next().unwrap_or_default();
        (line(at), label.split_whitespace().collect::<Vec<_>>().join(" ").to_lowercase())
    });
    let unknown = used.filter(|(_, label)| !label.is_empty() && !labels.contains(label)).collect();
    (targets, unknown)
}

/// Anchors of the headings, as hosts of Git repositories make them.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut count: BTreeMap<String, usize> = BTreeMap::new();
    let mut anchors = BTreeSet::new();
    for line in without_fences(text).lines() {
        let level = line.len() - line.trim_start_matches('#').len();
        let Some(heading) = line.get(level..).and_then(|rest| rest.strip_prefix(' ')) else {
            continue;
        };
        if !(1..=6).contains(&level) {
            continue;
        }
        let slug = slug(heading);
        let of_same = count.entry(slug.clone()).or_default();
        anchors.insert(match *of_same {
            0 => slug,
            number => format!("{slug}-{number}"),
        });
        *of_same += 1;
    }
    anchors
}

/// Anchor of a heading.
fn slug(heading: &str) -> String {
    // of a link only its text counts
    let mut text = String::new();
    let mut rest = heading.trim();
    while let Some((before, after)) = rest.split_once("](") {
        text += before;
        rest = after.split_once(')').map_or("", |(_, rest)| rest);
    }
    text += rest;
    let letters = text.trim().chars().flat_map(char::to_lowercase);
    letters
        .filter(|letter| letter.is_alphanumeric() || " -_".contains(*letter))
        .map(|letter| if letter == ' ' { '-' } else { letter })
        .collect()
}

/// Path from the root of a link's target on a page; none if it leads out of the project.
fn resolved(page: &str, target: &str) -> Option<String> {
    let mut parts: Vec<&str> = page.split('/').collect();
    parts.pop();
    for part in target.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            name => parts.push(name),
        }
    }
    Some(parts.join("/"))
}

#[test]
fn every_link_leads_to_a_file_and_a_heading() {
    let documents = documents();
    let anchors: BTreeMap<&str, BTreeSet<String>> =
        documents.iter().map(|(path, text)| (path.as_str(), anchors(text))).collect();
    let (mut wrong, mut count) = (Vec::new(), 0);
    for (page, text) in &documents {
        let (targets, unknown) = links(&without_code_spans(&without_fences(text)));
        wrong.extend(unknown.iter().map(|(line, label)| format!("{page}:{line}: no [{label}]:")));
        for (line, target) in targets {
            count += 1;
            let (path, anchor) = target.split_once('#').unwrap_or((target.as_str(), ""));
            if path.split('/').next().is_some_and(|start| start.contains(':')) {
                continue;
            }
            let file = match path {
                "" => Some(page.clone()),
                _ if path.starts_with('/') => None,
                _ => resolved(page, path),
            };
            let exists = file.as_ref().is_some_and(|file| root().join(file).exists());
            let known = file.as_ref().and_then(|file| anchors.get(file.as_str()));
            let has_heading = anchor.is_empty() || known.is_none_or(|known| known.contains(anchor));
            if !exists || target.is_empty() {
                wrong.push(format!("{page}:{line}: no file at {target:?}"));
            } else if !has_heading {
                wrong.push(format!("{page}:{line}: no heading for {target:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(count > 100, "{count} links");
}

/// Pages by purpose, which index and book list; records of the notebook are listed by its own page.
fn is_by_purpose(path: &str) -> bool {
    let is_index = path == "docs/README.md" || path == "docs/SUMMARY.md";
    path.starts_with("docs/") && !path.starts_with("docs/notebook/") && !is_index
}

#[test]
fn every_page_is_listed_in_index_and_book() {
    let documents = documents();
    for index in ["docs/README.md", "docs/SUMMARY.md"] {
        let (targets, _) = links(&without_fences(&documents[index]));
        let listed: BTreeSet<String> =
            targets.iter().filter_map(|(_, target)| resolved(index, target)).collect();
        for page in documents.keys().filter(|page| is_by_purpose(page)) {
            assert!(listed.contains(page), "{index} does not list {page}");
        }
    }
}

#[test]
fn lines_of_documents_fit_a_screen() {
    let documents = documents();
    let mut wrong = Vec::new();
    for (page, text) in &documents {
        let is_record = page.starts_with("docs/notebook/");
        for (number, line) in without_fences(text).lines().enumerate() {
            let letters = line.chars().count();
            if letters > LINE && !is_record && !line.trim_start().starts_with('|') {
                wrong.push(format!("{page}:{}: {letters} letters", number + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "lines of more than {LINE} letters:\n{}", wrong.join("\n"));
    let (most_lines, most_letters) = README;
    let first = &documents["README.md"];
    assert!(first.lines().count() <= most_lines, "README.md: {} lines", first.lines().count());
    let longest = first.lines().map(|line| line.chars().count()).max();
    assert!(longest <= Some(most_letters), "README.md: a line of {longest:?} letters");
}

#[test]
fn markdown_is_read_as_a_host_reads_it() {
    assert_eq!(
        slug("The `--json` of *all*: [commands](a.md), `section_name`"),
        "the---json-of-all-commands-section_name"
    );
    let headings = anchors("# One\n## One\n```sh\n# no heading\n```\n#none\n");
    assert_eq!(headings, BTreeSet::from(["one", "one-1"].map(String::from)));
    let text = "a [b](c.md#d \"title\"), `[e](f.md)` ![g](<h i.png>)\n\n~~~\n[j](k.md)\n~~~\n[l][m] [n][O]\n[o]: p.md\n";
    let (targets, unknown) = links(&without_code_spans(&without_fences(text)));
    let targets: Vec<&str> = targets.iter().map(|(_, target)| target.as_str()).collect();
    assert_eq!(targets, ["c.md#d", "h i.png", "p.md"]);
    assert_eq!(unknown, [(6, "m".to_string())]);
    assert_eq!(without_code_spans("``a`b`` c `d"), "    c `d");
    assert_eq!(resolved("docs/a/b.md", "../../c.md").as_deref(), Some("c.md"));
    assert_eq!(resolved("docs/a.md", "../../c.md"), None);
}
