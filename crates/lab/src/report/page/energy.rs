//! Energy balance of a cycle, and numerical damping of the time steps.

use super::optional;
use crate::LabError;
use crate::energy_audit::{Balance, PUMP_WORK};
use crate::report::drawing_data::figure;
use crate::report::figure::{Axes, Figure, Series};
use crate::study::Study;
use maud::{Markup, html};

pub(super) fn energy(study: &Study) -> Result<Markup, LabError> {
    let drawn = match study.energy.audits.last() {
        Some(audit) => {
            let over =
                |of: fn(&Balance) -> f64| audit.trace.iter().map(|b| (b.time, of(b))).collect();
            let series = Series::list([
                ("pump work, net", over(|b| b.work)),
                ("losses", over(|b| b.losses)),
                ("stored, gained", over(|b| b.gained.total())),
                ("of it gravitational", over(|b| b.gained.gravitational)),
            ]);
            let y = "energy since the start [J]";
            let svg = Figure { x: "time [s]", y, series, axes: Axes::Linear }.drawn()?;
            figure(
                "Energy over the fast cycle: what is stored is the net pump work less the losses.",
                &svg,
            )
        }
        None => html! {},
    };
    Ok(html! {
        h2 { "Energy" }
        (drawn)
        p.soft {
            "One fast cycle under velocity feedforward: change of stored energy against the net pump work, all "
            "losses, and the mass defects of equations that conserve volume and not mass. " (PUMP_WORK) " "
            "The residual is the implicit scheme's own error and shrinks with its step."
        }
        div.wide { table {
            thead { tr {
                th { "step [us]" } th { "change [J]" } th { "pump work [J]" } th { "losses [J]" }
                th { "defects [J]" } th { "exchanged [J]" } th { "residual / exchanged" }
            } }
            tbody { @for a in &study.energy.audits { tr {
                td { (format!("{:.0}", a.step_us)) } td { (format!("{:.2}", a.change_j)) }
                td { (format!("{:.2}", a.work_j)) } td { (format!("{:.2}", a.losses_j)) }
                td { (format!("{:.2}", a.defects_j)) } td { (format!("{:.1}", a.exchanged_j)) }
                td { (format!("{:.1e}", a.relative_residual)) }
            } } }
        } }
        p.soft {
            "What the time step itself adds to the lowest mode, on the same crane without any loss and "
            "with its load held: from the eigenvalues of one step's derivative."
        }
        div.wide { table {
            thead { tr { th { "scheme" } th { "step [us]" } th { "damping ratio" } th { "frequency error" } th { "order" } } }
            tbody { @for s in &study.energy.numerical_damping { tr {
                td { (s.scheme) } td { (format!("{:.0}", s.step_us)) }
                td { (format!("{:.1e}", s.damping_ratio)) }
                td { (format!("{:.1e}", s.frequency_error)) } td { (optional(s.order, 2)) }
            } } }
        } }
        @if let Some(a) = study.energy.audits.last() {
            details { summary { "Each power's share" }
                table { tbody { @for (name, energy) in &a.by_name_j {
                    tr { td { (name.replace('_', " ")) } td { (format!("{energy:.3} J")) } }
                } } }
            }
        }
    })
}
