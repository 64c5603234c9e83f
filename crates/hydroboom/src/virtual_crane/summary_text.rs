//! Summary of a run of the virtual crane as text.

use crate::output;
use hydroboom_lab::virtual_estimates::Compared;
use hydroboom_lab::virtual_run::Summary;

/// Column headings of the table of estimates.
const ESTIMATES: [&str; 5] =
    ["quantity", "estimated", "standard deviation", "true", "RMS error over the run"];

/// Duration, tracking error, final state, and the estimates beside the true values.
pub fn summary_text(crane: &str, summary: &Summary) -> String {
    let mut text = format!("{crane}: {:.3} s", summary.duration_s);
    let [rms, rms_measured, peak, peak_measured] = summary.error.cells();
    if let Some(oscillation) = summary.sustained_oscillation {
        text += &format!(", UNSTABLE, in sustained oscillation of {oscillation}");
    } else if rms.is_finite() {
        text += &format!(
            ", tracking error RMS true {rms:.3} mm, measured {rms_measured:.3} mm, peak true {peak:.3} mm, measured {peak_measured:.3} mm"
        );
    }
    text += &format!(
        "; at the end x_cyl {:.3} mm, p_A {:.2} bar, oil {:.2} C; largest motor torque {:.1} N m",
        summary.stroke_mm, summary.pressure_a_bar, summary.oil_c, summary.torque_nm
    );
    if let Some(estimates) = &summary.estimates {
        text += &format!(
            "\n\nstate estimator of scheduled-lqr beside the virtual crane, at the end:\n{}",
            output::table(&ESTIMATES, &estimates.iter().map(estimate_row).collect::<Vec<_>>())
        );
    }
    text
}

/// Row of an estimated quantity, in the unit of its name.
fn estimate_row((name, compared): (&str, &Compared)) -> Vec<String> {
    let Compared { estimated, deviation, true_value, rms_error } = compared;
    let number = |value: Option<f64>| output::optional(value, 3);
    vec![
        name.into(),
        number(Some(*estimated)),
        number(*deviation),
        number(*true_value),
        number(*rms_error),
    ]
}
