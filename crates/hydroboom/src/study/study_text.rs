//! Results of the study as text, "paper | here".

use crate::motion::tracking_table::tracking_table;
use crate::{eigen, energy, output};
use hydroboom_lab::claims;
use hydroboom_lab::closed_loop::metrics::TrackingError;
use hydroboom_lab::study::{NOMINAL, OFF, Study, VIRTUAL};

/// All results: claims, Tables 5 to 9, double damping, energy.
pub fn study_text(study: &Study) -> String {
    let mut text = format!(
        "{}\n\n{}\n\n{}\n\n{}\n\n{}",
        claims_text(study),
        eigenfrequency_text(study),
        pressure_oscillation_text(study),
        model_error_text(study),
        tracking_table(&study.motion)
    );
    for remark in study.unstable_loops().iter().chain(&study.remark_on_gains) {
        text += &format!("\n{remark}");
    }
    text + &format!("\n\n{}\n\n{}", double_damping_text(study), energy::table(&study.energy.audits))
}

/// Table 5, and the eigenfrequencies of the virtual crane \[Hz\].
fn eigenfrequency_text(study: &Study) -> String {
    let mut text = eigen::table(&study.eigenfrequency);
    if let Some(hz) = study.virtual_eigenfrequency_hz {
        let hz = hz.map(three_decimals).join(", ");
        let beside = if study.is_papers_crane { ", beside \"paper measured\"" } else { "" };
        text += &format!("\nvirtual crane{beside}: {hz}");
    }
    text
}

/// Frequency of the p_A oscillation with open valve \[Hz\].
fn pressure_oscillation_text(study: &Study) -> String {
    let beside = |paper: Option<f64>, which: &str| {
        paper.map_or_else(String::new, |hz| format!(" (paper {which} {hz:.3})"))
    };
    let mut text = format!(
        "p_A oscillation, valve open [Hz]: nominal {}{}",
        output::optional(study.pressure_oscillation_hz, 3),
        beside(study.paper_pressure_oscillation_hz, "simulated")
    );
    if let Some(hz) = study.virtual_pressure_oscillation_hz {
        let paper = beside(study.paper_measured_pressure_oscillation_hz, "measured");
        text += &format!(", virtual crane {hz:.3}{paper}");
    }
    text
}

/// Table 6: differences of the plants from the model.
fn model_error_text(study: &Study) -> String {
    let rows: Vec<Vec<String>> = study
        .differences
        .iter()
        .map(|d| {
            vec![
                format!("{} [{}]", d.signal, d.unit),
                output::optional(d.paper_rms, 3),
                output::optional(d.virtual_rms, 3),
                three_decimals(d.off_model_rms),
                output::optional(d.paper_peak, 3),
                output::optional(d.virtual_peak, 3),
                three_decimals(d.off_model_peak),
            ]
        })
        .collect();
    let header = [
        "signal",
        "RMS paper",
        "RMS virtual",
        "RMS off-model",
        "peak paper",
        "peak virtual",
        "peak off-model",
    ];
    let (header, rows) = without_virtual(study, &header, rows);
    format!(
        "{} less model as measured, at the fast speed under velocity feedforward{}\n{}",
        if study.is_papers_crane { "Table 6: plant" } else { "Plant" },
        if study.is_papers_crane { "; the paper's plant is its real crane" } else { "" },
        output::table_beside_paper(&header, &rows)
    )
}

/// Tracking errors with one and with two dampings of simulation feedforward in closed loop.
fn double_damping_text(study: &Study) -> String {
    let rows: Vec<Vec<String>> = study
        .double_damping
        .iter()
        .flat_map(|d| {
            d.laws().map(|(law, result)| {
                let names = [d.plant.clone(), d.course.clone(), law.to_string()];
                let cells = match result {
                    Ok(error) => error.cells().map(three_decimals),
                    Err(word) => [(); 4].map(|()| word.into()),
                };
                names.into_iter().chain(cells).collect()
            })
        })
        .collect();
    let mut header = vec!["plant", "course", "law"];
    header.extend(TrackingError::HEADS);
    format!("Simulation feedforward in closed loop damps twice\n{}", output::table(&header, &rows))
}

fn three_decimals(value: f64) -> String {
    format!("{value:.3}")
}

/// Table without the virtual crane's columns if there is none.
fn without_virtual<'a>(
    study: &Study,
    header: &[&'a str],
    rows: Vec<Vec<String>>,
) -> (Vec<&'a str>, Vec<Vec<String>>) {
    let is_shown =
        |head: &str| study.virtual_eigenfrequency_hz.is_some() || !head.contains("virtual");
    let shown: Vec<usize> = (0..header.len()).filter(|k| is_shown(header[*k])).collect();
    let rows = rows.into_iter().map(|row| shown.iter().map(|k| row[*k].clone()).collect());
    (shown.iter().map(|k| header[*k]).collect(), rows.collect())
}

/// Main claims of the paper, "paper | here".
fn claims_text(study: &Study) -> String {
    let cells: Vec<[String; 8]> = study
        .claims
        .iter()
        .map(|claim| {
            let on = |plant| claim.on(plant);
            let one = |value: Option<f64>| output::optional(value, claim.digits());
            [
                format!("{} [{}]", claim.compares, claim.unit),
                one(claim.paper_stated),
                one(claim.paper_tables),
                one(on(NOMINAL).map(|figure| figure.measured)),
                one(on(OFF).map(|figure| figure.measured)),
                one(on(VIRTUAL).map(|figure| figure.measured)),
                one(on(VIRTUAL).map(|figure| figure.truth)),
                claim.worse_on().join(", "),
            ]
        })
        .collect();
    let header = [
        "compared",
        "paper states",
        "its tables",
        "nominal",
        "off-model",
        "virtual measured",
        "virtual true",
        "worse than the paper on",
    ];
    let is_shown = |column: &usize| match header[*column] {
        "paper states" | "its tables" | "worse than the paper on" => study.is_papers_crane,
        "virtual measured" | "virtual true" => study.virtual_eigenfrequency_hz.is_some(),
        _ => true,
    };
    let columns: Vec<usize> = (0..header.len()).filter(is_shown).collect();
    let header: Vec<&str> = columns.iter().map(|k| header[*k]).collect();
    let rows: Vec<Vec<String>> =
        cells.iter().map(|row| columns.iter().map(|k| row[*k].clone()).collect()).collect();
    let on_paper = match study.is_papers_crane {
        true => format!("\n{}", claims::REMARK_ON_PAPER),
        false => String::new(),
    };
    let against = study.eigenfrequency_accuracy_percent.map_or_else(String::new, |percent| {
        format!("\nAgainst the eigenfrequencies that the paper measured, our model's mean accuracy is {percent:.1} %.")
    });
    format!(
        "{}; nominal and off-model plant have ideal sensors, measured and true is the same there\n{}\n{}{against}",
        if study.is_papers_crane {
            "The paper's headline claims"
        } else {
            "What the paper's headline claims are of, on this crane"
        },
        output::table(&header, &rows),
        claims::REMARK.replace(". ", ".\n") + &on_paper,
    )
}
