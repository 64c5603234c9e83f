//! Tables of results in the documents, as their commands compute them.
//!
//! A table whose command takes less than 10 s, or runs for another test anyhow, stands between two comments:
//!
//! ```text
//! <!-- table NAME: COMMAND -->
//! <!-- end of table -->
//! ```
//!
//! All computed numbers between them are the command's. After a change on purpose this writes them:
//!
//! ```sh
//! HYDROBOOM_WRITE_RESULT_TABLES=1 cargo test -p hydroboom --test integration result_tables
//! ```

mod bounds;
mod cells;
mod design;
mod export;
mod study;

use crate::documents::{documents, root};
use crate::support::command::parsed;
use crate::support::study::study;
use cells::Rows;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::sync::{Mutex, PoisonError};

/// Environment variable: if set, tables are written instead of compared.
const WRITES: &str = "HYDROBOOM_WRITE_RESULT_TABLES";

/// What writes all tables.
const COMMAND: &str =
    "HYDROBOOM_WRITE_RESULT_TABLES=1 cargo test -p hydroboom --test integration result_tables";

/// Names of the months in dates.
const MONTHS: [&str; 12] = [
    "January",
    "February",
    "March",
    "April",
    "May",
    "June",
    "July",
    "August",
    "September",
    "October",
    "November",
    "December",
];

/// Comment behind a table.
const END: &str = "<!-- end of table -->";

/// Table of a page.
struct Table {
    /// Page by its path from the root.
    page: &'static str,
    /// Name in the comment before the table, unique in the project.
    name: &'static str,
    /// Head and rows from the command's JSON.
    rows: fn(&Value) -> Rows,
}

/// Tables that one command computes.
struct Results {
    /// Command as the comment before the tables states it.
    command: &'static str,
    tables: &'static [Table],
}

const STUDY: Results = Results {
    command: "hydroboom study --json",
    tables: &[
        Table { page: "README.md", name: "published-model", rows: study::published_model },
        Table { page: "README.md", name: "virtual-crane", rows: study::virtual_crane },
        Table {
            page: "docs/explanation/adding-and-following.md",
            name: "double-damping",
            rows: study::double_damping,
        },
        Table {
            page: "docs/reference/computing-time.md",
            name: "step-errors",
            rows: study::step_errors,
        },
        Table {
            page: "docs/reference/virtual-crane.md",
            name: "not-calibrated",
            rows: study::not_calibrated,
        },
    ],
};

const BOUNDS: Results = Results {
    command: "hydroboom bounds --json",
    tables: &[
        Table {
            page: "docs/explanation/limits-of-performance.md",
            name: "bounds",
            rows: bounds::limits,
        },
        Table {
            page: "docs/explanation/limits-of-performance.md",
            name: "over-the-bound",
            rows: bounds::over_the_bound,
        },
    ],
};

const MARGINS: Results = Results {
    command: "hydroboom design --json",
    tables: &[Table {
        page: "docs/reference/scheduled-lqr.md",
        name: "margins",
        rows: design::margins,
    }],
};

const GAINS: Results = Results {
    command: "hydroboom design --benchmark --payload-kg LOW:HIGH --json",
    tables: &[Table {
        page: "docs/reference/scheduled-lqr.md",
        name: "benchmark-gains",
        rows: design::benchmark_gains,
    }],
};

const OPERATIONS: Results = Results {
    command: "hydroboom export count --json",
    tables: &[
        Table { page: "docs/reference/export.md", name: "operations", rows: export::operations },
        Table {
            page: "docs/reference/export-controllers.md",
            name: "memory",
            rows: export::memory,
        },
    ],
};

const ALL: [&Results; 5] = [&STUDY, &BOUNDS, &MARGINS, &GAINS, &OPERATIONS];

#[test]
fn tables_of_the_study_have_its_results() {
    compare(&STUDY, &study().0);
}

#[test]
fn tables_of_the_bounds_have_their_results() {
    compare(&BOUNDS, &parsed(&["bounds", "--json"]));
}

#[test]
fn tables_of_the_design_have_its_results() {
    compare(&MARGINS, &parsed(&["design", "--json"]));
    let designed = design::PAYLOADS_KG.map(|[low, high]| {
        let payloads = format!("{low}:{high}");
        parsed(&["design", "--benchmark", "--payload-kg", &payloads, "--json"])
    });
    compare(&GAINS, &json!(designed));
}

#[test]
fn tables_of_the_export_have_its_operations_and_memory() {
    compare(&OPERATIONS, &parsed(&["export", "count", "--json"]));
}

/// A table between comments that no command computes would not be compared.
#[test]
fn every_table_between_comments_is_compared() {
    let mut marked = Vec::new();
    for (page, text) in documents() {
        let comments = text.lines().filter(|line| line.starts_with("<!-- table "));
        marked.extend(comments.map(|line| (page.clone(), line.to_string())));
        let ends = text.lines().filter(|line| *line == END).count();
        let begins = marked.iter().filter(|(its, _)| *its == page).count();
        assert_eq!(begins, ends, "{page}: comments before and behind tables");
    }
    marked.sort();
    let compared = ALL.iter().flat_map(|results| {
        results.tables.iter().map(|table| (table.page.to_string(), comment(results, table)))
    });
    let mut compared: Vec<(String, String)> = compared.collect();
    compared.sort();
    assert_eq!(marked, compared);
    let names: BTreeSet<&str> =
        ALL.iter().flat_map(|results| results.tables.iter().map(|table| table.name)).collect();
    assert_eq!(names.len(), compared.len(), "two tables have one name");
}

/// Tables that are not compared have a line below them that says what wrote them.
#[test]
fn lines_below_tables_state_commit_and_date() {
    let mut count = 0;
    for (page, text) in documents() {
        for line in text.split("\n\n").filter(|paragraph| paragraph.starts_with("Written by ")) {
            let words: Vec<&str> = line
                .split_whitespace()
                .map(|word| word.trim_end_matches(['.', ',', ';']))
                .collect();
            let is_commit = |word: &&str| {
                word.len() == 7 && word.bytes().all(|letter| letter.is_ascii_hexdigit())
            };
            let is_date = |date: &[&str]| {
                let [day, month, year] = date else { return false };
                let is_day = day.parse().is_ok_and(|day: u32| (1..=31).contains(&day));
                is_day && MONTHS.contains(month) && year.parse::<u32>().is_ok()
            };
            assert!(words.iter().any(is_commit), "{page}: no commit in\n{line}");
            assert!(words.windows(3).any(is_date), "{page}: no date in\n{line}");
            count += 1;
        }
    }
    assert!(count > 20, "{count} lines");
}

/// Comment before a table.
fn comment(results: &Results, table: &Table) -> String {
    format!("<!-- table {}: {} -->", table.name, results.command)
}

/// Compares the tables of a command with those of the pages, or writes them.
fn compare(results: &Results, printed: &Value) {
    // tests run in parallel, and a page may have tables of two commands
    static PAGES: Mutex<()> = Mutex::new(());
    let _one = PAGES.lock().unwrap_or_else(PoisonError::into_inner);
    let mut differences = Vec::new();
    for table in results.tables {
        let path = root().join(table.page);
        let text = fs::read_to_string(&path).unwrap();
        let comment = comment(results, table);
        let found = text.split_once(comment.as_str());
        let found = found.and_then(|(before, rest)| Some((before, rest.split_once(END)?)));
        let Some((before, (there, behind))) = found else {
            panic!("{} has no table between {comment} and {END}", table.page);
        };
        let computed = markdown(&(table.rows)(printed));
        if there == computed {
            continue;
        }
        if std::env::var_os(WRITES).is_some() {
            fs::write(&path, [before, &comment, &computed, END, behind].concat()).unwrap();
        } else {
            differences.push(format!(
                "{}, table {}:{there}is with `{}`:{computed}",
                table.page, table.name, results.command
            ));
        }
    }
    assert!(
        differences.is_empty(),
        "{}If that is meant, this writes the tables; then read the text around them:\n{COMMAND}",
        differences.join("")
    );
}

/// Head, rule and rows, with the empty line before the comment behind the table.
fn markdown(rows: &[Vec<String>]) -> String {
    let line = |cells: &Vec<String>| {
        let cell = |text: &String| if text.is_empty() { " |".into() } else { format!(" {text} |") };
        format!("|{}\n", cells.iter().map(cell).collect::<String>())
    };
    let rule = format!("|{}\n", "---|".repeat(rows[0].len()));
    let below: String = rows[1..].iter().map(line).collect();
    format!("\n{}{rule}{below}\n", line(&rows[0]))
}
