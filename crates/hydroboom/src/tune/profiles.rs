//! Profile likelihood of single keys: option, computation and results.

use super::five_digits::FiveDigits;
use clap::Args;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::{Fit, Free, IdentifyError, LIMIT, Profile, Task, profile};
use hydroboom_lab::LabError;
use hydroboom_lab::report::{Axes, Figure, Series, figure};
use indicatif::ProgressBar;
use maud::Markup;
use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};
use std::sync::atomic::{AtomicBool, Ordering};

/// The option that asks for profiles.
#[derive(Args, Clone)]
pub struct Profiles {
    /// Keys whose profile likelihood is computed: each is fixed at values about its optimum, and all others
    /// are fitted again. Keys with commas between them, or `weak` for those that the logs do not determine.
    #[arg(long, value_name = "KEYS", value_delimiter = ',')]
    profile: Vec<String>,
}

impl Profiles {
    /// Computes the requested profiles about the optimum of a fit; those completed if `stop` is set.
    ///
    /// # Errors
    ///
    /// If a key is unknown or not among those of the fit, or a simulation fails.
    pub fn compute(&self, task: &Task<'_>, fit: &Fit, stop: &AtomicBool) -> Result<Vec<Profile>> {
        let keys = match self.profile.as_slice() {
            [only] if only == "weak" => {
                let weak = fit.tuned.iter().filter(|tuned| !tuned.is_determined());
                weak.map(|tuned| tuned.key).collect()
            }
            named => named
                .iter()
                .map(|path| Free::from_path(path.trim()).into_diagnostic())
                .collect::<Result<Vec<Free>>>()?,
        };
        let bar = ProgressBar::new_spinner();
        let mut profiles = Vec::new();
        for (k, key) in keys.iter().enumerate() {
            let result = profile(task, fit, *key, &|progress| {
                let (path, of) = (key.path(), keys.len());
                bar.set_message(format!(
                    "profile {} of {of}, {path}: {} runs, {:.0} left",
                    k + 1,
                    progress.runs,
                    progress.cost
                ));
                bar.tick();
                !stop.load(Ordering::Relaxed)
            });
            match result {
                Err(IdentifyError::Stopped) => {
                    bar.println(format!("stopped; {k} of {} profiles are done", keys.len()));
                    break;
                }
                result => profiles.push(result.into_diagnostic()?),
            }
        }
        bar.finish_and_clear();
        Ok(profiles)
    }
}

/// Values of a key that the logs contradict, in a sentence without its full stop.
fn sentence(profile: &Profile) -> String {
    let key = &KEYS[profile.key.place];
    let shown = |v: f64| FiveDigits(key.to_unit(v)).to_string();
    let ends = [profile.points.first(), profile.points.last()];
    let [lowest, highest] = ends.map(|point| shown(point.map_or(f64::NAN, |point| point.0)));
    let path = key.path();
    match profile.interval.map(|v| v.map(shown)) {
        [Some(low), Some(high)] => {
            format!("{path}: the logs contradict less than {low} and more than {high}")
        }
        [Some(low), None] => {
            format!("{path}: the logs contradict less than {low}, and nothing up to {highest}")
        }
        [None, Some(high)] => {
            format!("{path}: the logs contradict more than {high}, and nothing down to {lowest}")
        }
        [None, None] => {
            format!("{path}: the logs contradict nothing between {lowest} and {highest}")
        }
    }
}

/// Text below the table of keys.
pub fn text(profiles: &[Profile]) -> String {
    let lines: Vec<String> = profiles.iter().map(|p| format!("  {}", sentence(p))).collect();
    format!(
        "for any values of the other keys, without the prior of this one (profile likelihood, 95 %):\n{}",
        lines.join("\n")
    )
}

/// Profiles as JSON.
pub fn in_json(profiles: &[Profile]) -> Vec<Value> {
    let of = |p: &Profile| {
        let key = &KEYS[p.key.place];
        json!({
            "key": key.path(), "limit": LIMIT, "interval_95": p.interval.map(|v| v.map(|v| key.to_unit(v))),
            "points": p.points.iter().map(|(v, rise)| json!([key.to_unit(*v), rise])).collect::<Vec<_>>(),
        })
    };
    profiles.iter().map(of).collect()
}

/// Figure of a profile with its caption, beside the parabola that the interval of the table assumes.
///
/// # Errors
///
/// [`LabError`] if the figure cannot be drawn.
pub fn profile_figure(profile: &Profile, fit: &Fit) -> std::result::Result<Markup, LabError> {
    let key = &KEYS[profile.key.place];
    let points: Vec<(f64, f64)> =
        profile.points.iter().map(|(v, rise)| (key.to_unit(*v), *rise)).collect();
    let ends = [points.first(), points.last()].map(|p| p.map_or(0.0, |p| p.0));
    let mut lines = vec![("profile", points.clone())];
    // parabola assumed by the intervals of the table
    let tuned = fit.tuned.iter().find(|tuned| tuned.key == profile.key);
    if let Some(tuned) = tuned.filter(|t| t.others_exact.is_finite()) {
        let middle = key.to_unit(tuned.value.1);
        let at = |k: i32| ends[0] + (ends[1] - ends[0]) * f64::from(k) / 40.0;
        let rise = |v: f64| ((v / middle).ln() / tuned.others_exact).powi(2);
        let highest = points.iter().map(|p| p.1).fold(1.5 * LIMIT, f64::max);
        let parabola = (0..=40).map(|k| (at(k), rise(at(k)))).filter(|p| p.1 <= highest).collect();
        lines.push(("parabola of the table's interval", parabola));
    }
    lines.push(("contradicted above", vec![(ends[0], LIMIT), (ends[1], LIMIT)]));
    let (x, y) = (format!("{} [{}]", key.path(), key.unit), "rise of the sum [squared deviations]");
    let svg = Figure { x: &x, y, series: Series::list(lines), axes: Axes::Linear }.drawn()?;
    Ok(figure(&format!("{}.", sentence(profile)), &svg))
}
