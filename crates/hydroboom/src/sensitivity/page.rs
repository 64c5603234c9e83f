//! Report of the sensitivities.

use super::analysis::Analysis;
use hydroboom_description::Description;
use hydroboom_description::schema::KEYS;
use hydroboom_lab::LabError;
use hydroboom_lab::report::{Bar, Bars, Drawing, Page, document, figure};
use hydroboom_sensitivity::Sobol;
use maud::{Markup, html};

/// Number of keys in the tornado diagram of an output.
const MOST_CHANGES: usize = 10;
/// Number of keys in the bar chart of the Sobol indices of an output.
const MOST_INDICES: usize = 12;

/// Page with a tornado diagram and Sobol indices for each output.
///
/// # Errors
///
/// [`LabError`] if a figure cannot be drawn.
pub fn page(crane: &Description, analysis: &Analysis) -> Result<Page, LabError> {
    let sections = (0..analysis.outputs.len()).map(|k| output_section(analysis, k));
    let sections = sections.collect::<Result<Vec<Markup>, LabError>>()?;
    let body = html! {
        p.soft {
            "\"" (crane.name) "\" along its motion at " (format!("{:.0}", analysis.case.motion.speed * 1e3)) " mm/s. What varies is the machine; its "
            "controllers and the simulation beside it keep the described parameters. Sensors and motor are ideal."
        }
        @for section in &sections { (section) }
        (index_tables(analysis))
    };
    Ok(document("Hydroboom: sensitivity", &body))
}

/// Figures of an output.
fn output_section(analysis: &Analysis, k: usize) -> Result<Markup, LabError> {
    let output = &analysis.outputs[k];
    let (unit, size) = output.unit();
    let tornado = tornado_diagram(analysis, k)?;
    let indices = match analysis.indices(k) {
        Some(indices) => Some(index_chart(analysis, indices)?),
        None => None,
    };
    Ok(html! {
        h2 { (output.title()) ": " (format!("{:.3} {unit}", analysis.values[k] / size)) }
        @if let Some(conditions) = analysis.case.conditions(*output) {
            p.soft { (conditions) }
        }
        (figure(
            "Change of the output with the machine re-run at both ends of a key's prior range, by its provenance. The ten keys of the \
             largest change.",
            &tornado,
        ))
        @if let Some(chart) = &indices {
            (figure(
                "Total Sobol index: share of the output's variance that remains if all other keys are known, \
                 with its 95 % interval.",
                chart,
            ))
        }
    })
}

/// Changes of an output by the keys of the largest change, a bar for each end of a key's range.
fn tornado_diagram(analysis: &Analysis, k: usize) -> Result<Drawing, LabError> {
    let (unit, size) = analysis.outputs[k].unit();
    // one bar per end: near a minimum both are on one side
    let mut changes = Vec::new();
    for key in analysis.ranked(k).into_iter().take(MOST_CHANGES) {
        let free = analysis.local[key].key;
        let (path, key_unit) = (free.path(), KEYS[free.place].unit);
        for end in [0, 1] {
            if let Some(there) = analysis.at_end(key, end, k) {
                let name = format!("{path} {} {key_unit}", analysis.end_text(key, end));
                changes.push((name, (there - analysis.values[k]) / size, 1 - end));
            }
        }
    }
    let bars = changes.iter().map(|(name, change, colour)| Bar {
        name,
        from: 0.0,
        to: *change,
        colour: *colour,
        bounds: None,
    });
    let x = format!("change [{unit}]");
    Bars { x: &x, bars: bars.collect() }.drawn()
}

/// Total Sobol indices of an output with their 95 % intervals, the largest first.
fn index_chart(analysis: &Analysis, indices: &Sobol) -> Result<Drawing, LabError> {
    let mut order: Vec<usize> = (0..analysis.local.len()).collect();
    let total = |place: usize| indices.total[place].value;
    order.sort_by(|a, b| total(*b).total_cmp(&total(*a)));
    let names: Vec<String> = order.iter().map(|place| analysis.local[*place].key.path()).collect();
    let bars = order.iter().zip(&names).take(MOST_INDICES).map(|(place, name)| {
        let i = indices.total[*place];
        Bar { name, from: 0.0, to: i.value, colour: 0, bounds: Some((i.low, i.high)) }
    });
    let x = "total Sobol index, share of the variance [-]";
    Bars { x, bars: bars.collect() }.drawn()
}

/// Sobol indices of all outputs in numbers; empty without a global study.
fn index_tables(analysis: &Analysis) -> Markup {
    html! {
        @if let Some((indices, rows)) = &analysis.global {
            h2 { "Sobol indices in numbers" }
            p.soft { (rows) " rows; the logarithm of every key is uniform, with the standard deviation of its provenance." }
            @for (output, sobol) in analysis.outputs.iter().zip(indices) {
                h3 {
                    (output.title()) ": " (format!("{:.3} {}", sobol.mean / output.unit().1, output.unit().0)) " in the mean, deviation "
                    (format!("{:.3}", sobol.deviation / output.unit().1))
                }
                div.wide { table {
                    thead { tr { th { "key" } th { "first order" } th { "95 %" } th { "total" } th { "95 %" } } }
                    tbody { @for (place, l) in analysis.local.iter().enumerate() {
                        @let (first, total) = (sobol.first[place], sobol.total[place]);
                        tr {
                            td { (l.key.path()) }
                            td { (format!("{:.3}", first.value)) } td { (format!("{:.2} .. {:.2}", first.low, first.high)) }
                            td { (format!("{:.3}", total.value)) } td { (format!("{:.2} .. {:.2}", total.low, total.high)) }
                        }
                    } }
                } }
            }
        }
    }
}
