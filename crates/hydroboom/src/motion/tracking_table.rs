//! Tables 7 to 9 of the paper: tracking errors of the strategies, with control effort and vibration of the tip.

use crate::output;
use hydroboom_lab::closed_loop::metrics::{MOTOR_ENERGY, TrackingError};
use hydroboom_lab::motion_test::{Row, instability_remarks, remark_on_mark};
use hydroboom_lab::report::IDEAL_SENSORS;

/// Error \[mm\] of a run; a note instead if the run oscillates or stopped.
fn error_cell(row: &Row, mm: f64) -> String {
    match (&row.stopped, row.stable) {
        (Some(_), _) => "stopped".into(),
        (None, true) => format!("{mm:.3}"),
        (None, false) => "unstable".into(),
    }
}

/// Control effort of a run with so many decimals; a dash if it stopped.
fn effort_cell(value: f64, digits: usize) -> String {
    output::optional(value.is_finite().then_some(value), digits)
}

/// Row without some columns.
fn without_columns<T: Clone>(row: &[T], omitted: &[usize]) -> Vec<T> {
    let rest = row.iter().enumerate().filter(|(column, _)| !omitted.contains(column));
    rest.map(|(_, cell)| cell.clone()).collect()
}

/// Tables 7 to 9, "paper | here", with remarks on oscillating runs.
pub fn tracking_table(rows: &[Row]) -> String {
    let is_ideal = |row: &Row| row.stopped.is_some() || row.error.is_measured_truly();
    let (ideal, mixed) = (rows.iter().all(is_ideal), rows.iter().any(is_ideal));
    let beside_paper = rows.iter().any(|row| row.paper_rms_mm.is_some());
    // columns without information are omitted
    let omitted: &[usize] = match (ideal, beside_paper) {
        (true, true) => &[5, 8],
        (true, false) => &[3, 5, 6, 8],
        (false, true) => &[],
        (false, false) => &[3, 6],
    };
    let sensors = match (ideal, mixed) {
        (true, _) => format!("\n{IDEAL_SENSORS}"),
        (false, true) => "\n=: sensors are ideal there, the measured error is the true one.".into(),
        (false, false) => String::new(),
    };
    let measured = |row: &Row, mm: f64| {
        if row.stopped.is_none() && is_ideal(row) { "=".into() } else { error_cell(row, mm) }
    };
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            without_columns(
                &[
                    r.marked_name(),
                    r.plant.clone(),
                    r.course.clone(),
                    output::optional(r.paper_rms_mm, 2),
                    error_cell(r, r.error.rms_true_mm),
                    measured(r, r.error.rms_measured_mm),
                    output::optional(r.paper_peak_mm, 2),
                    error_cell(r, r.error.peak_true_mm),
                    measured(r, r.error.peak_measured_mm),
                    effort_cell(r.effort.residual_vibration_mm, 3),
                    effort_cell(r.effort.energy_kj, 2),
                    effort_cell(r.effort.motor_speed_rpm, 0),
                ],
                omitted,
            )
        })
        .collect();
    let [rms_true, rms_measured, peak_true, peak_measured] = TrackingError::HEADS;
    let header = [
        "strategy",
        "plant",
        "course",
        "RMS paper [mm]",
        rms_true,
        rms_measured,
        "peak paper [mm]",
        peak_true,
        peak_measured,
        "residual vibration [mm]",
        "motor energy [kJ]",
        "motor [rpm]",
    ];
    let mark = remark_on_mark(rows).map(str::to_string);
    let remarks: String =
        mark.iter().chain(&instability_remarks(rows)).map(|remark| format!("\n{remark}")).collect();
    let title = match beside_paper {
        true => "Tables 7 to 9: tracking error x - x_ref [mm]; the paper measured a real crane.",
        false => "Tracking error x - x_ref [mm].",
    };
    format!(
        "{title} The scheduled LQR is not of the paper, and has\n\
         a preview of the reference of 0.4 s.\n\
         Beside it the RMS of the tip's vibration at rest, the motor energy and the largest motor speed.\n{MOTOR_ENERGY}\n{}{sensors}{remarks}",
        output::table(&without_columns(&header, omitted), &cells)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::strategy::Strategy;
    use hydroboom_lab::closed_loop::metrics::Effort;
    use hydroboom_lab::study::NOMINAL;

    fn row(rms_measured_mm: f64, paper_rms_mm: Option<f64>) -> Row {
        let error = TrackingError {
            rms_true_mm: 0.5,
            rms_measured_mm,
            peak_true_mm: 1.5,
            peak_measured_mm: 1.5,
        };
        Row {
            plant: NOMINAL.into(),
            strategy: Strategy::BenchmarkClosedLoop,
            course: "120 mm/s".into(),
            speed_mm_s: 120.0,
            stable: true,
            has_stable_loops: true,
            stopped: None,
            sustained_oscillation: None,
            error,
            effort: Effort::default(),
            paper_rms_mm,
            paper_peak_mm: paper_rms_mm,
        }
    }

    #[test]
    fn equal_true_and_measured_errors_are_printed_once() {
        let ideal = tracking_table(&[row(0.5, Some(0.42))]);
        assert!(ideal.contains("RMS true [mm]") && !ideal.contains("measured [mm]"), "{ideal}");
        assert!(ideal.contains(IDEAL_SENSORS), "{ideal}");
        let mixed = tracking_table(&[row(0.5, Some(0.42)), row(0.625, Some(0.42))]);
        assert!(mixed.contains("RMS measured [mm]") && mixed.contains("0.625"), "{mixed}");
        assert_eq!(
            (mixed.matches("0.500").count(), mixed.matches("=:").count()),
            (2, 1),
            "{mixed}"
        );
    }

    /// The row itself is marked, besides the remark below the table.
    #[test]
    fn a_row_of_an_unstable_loop_is_marked() {
        let swings = Row { has_stable_loops: false, ..row(0.5, None) };
        let text = tracking_table(&[row(0.5, None), swings]);
        let marked = |line: &str| line.starts_with("benchmark-closed-loop (!)");
        assert_eq!(text.lines().filter(|line| marked(line)).count(), 1, "{text}");
        assert!(text.contains("(!): its closed loop is unstable"), "{text}");
        assert!(!tracking_table(&[row(0.5, None)]).contains("(!)"));
    }

    /// The head of each error column says whether the error is true or measured.
    #[test]
    fn heads_of_error_columns_say_true_or_measured() {
        let text = tracking_table(&[row(0.625, None)]);
        let header = text.lines().find(|line| line.starts_with("strategy")).unwrap();
        for head in TrackingError::HEADS {
            assert!(header.contains(head), "{head}: {header}");
        }
        let of = |head: &str| header.find(head).unwrap();
        let line = text.lines().find(|line| line.starts_with("benchmark-closed-loop")).unwrap();
        let ends = |head: &str| line[..of(head) + head.len()].trim_end().to_string();
        assert!(ends("RMS true [mm]").ends_with("0.500"), "{text}");
        assert!(ends("RMS measured [mm]").ends_with("0.625"), "{text}");
    }

    #[test]
    fn columns_of_the_paper_without_numbers_are_left_out() {
        let other = tracking_table(&[row(0.5, None)]);
        assert!(!other.contains("RMS paper") && !other.contains("peak paper"), "{other}");
        let header = other.lines().find(|line| line.starts_with("strategy")).unwrap();
        assert!(header.contains("peak true [mm]"), "{header}");
        assert!(header.contains("residual vibration [mm]"), "{header}");
        assert!(other.contains("a preview of the reference of 0.4 s"), "{other}");
    }
}
