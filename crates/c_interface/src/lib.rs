//! A simulated crane as a C library: `include/hydroboom_live.h` says what each function does.
//!
//! Every pointer comes from a caller that the compiler knows nothing of. What can be checked is (null, sizes, text that is
//! UTF-8); what cannot (that a pointer is what the header asks for) is the caller's promise, as in every C library.

#![expect(unsafe_code, reason = "functions for C are called with pointers")]

use hydroboom_description::{Description, DescriptionError, Problem};
use hydroboom_model::{Input, Outputs, Scheme};
use hydroboom_plant::{Plant, plant};
use std::ffi::{CStr, CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr::{null, null_mut};
use std::sync::LazyLock;

/// A crane that C holds a pointer to.
pub struct Live {
    description: Description,
    plant: Box<dyn Plant>,
    message: CString,
}

/// Names and units of what can be seen, as C reads them.
static NAMES: LazyLock<[Vec<CString>; 2]> =
    LazyLock::new(|| [Outputs::NAMES, Outputs::UNITS].map(|all| all.map(spoken).to_vec()));

/// Text as C reads it: a zero within would end it.
fn spoken(text: impl Into<String>) -> CString {
    CString::new(text.into().replace('\0', " ")).unwrap_or_default()
}

/// Text from C; none for a null pointer.
///
/// # Safety
///
/// The pointer is null, or a text that ends with a zero and stays as it is for `'a`.
unsafe fn heard<'a>(text: *const c_char) -> Result<Option<&'a str>, String> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: not null, and by this function's own condition a text that ends
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map(Some).map_err(|_| "the text is not UTF-8".to_string())
}

/// What `work` says; a bug in it is said too and does not unwind into C, which could not bear that.
fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err("a bug in Hydroboom: this call panicked".into()))
}

/// All that is wrong with a crane file or a setting, and what to do about it.
fn listed(error: &DescriptionError) -> String {
    let of = |p: &Problem| match &p.help {
        Some(help) => format!("{} ({help})", p.message),
        None => p.message.clone(),
    };
    let problems: Vec<String> = error.problems.iter().map(of).collect();
    format!("{}: {}", error.name, problems.join("; "))
}

fn opened(path: Option<&str>, settings: Option<&str>) -> Result<Live, String> {
    let mut description = match path {
        None => Description::uia_single_boom(),
        Some(path) => {
            let text = std::fs::read_to_string(path).map_err(|e| format!("{path}: {e}"))?;
            Description::parse(path, &text)
        }
    }
    .map_err(|e| listed(&e))?;
    for line in settings.unwrap_or_default().lines().filter(|line| !line.trim().is_empty()) {
        description.set(line.trim()).map_err(|e| listed(&e))?;
    }
    let n = &description.numbers;
    let start = description.start(n.motion_start);
    let plant = plant(&description, &start, Scheme::Published, n.simulation_period)
        .map_err(|e| e.to_string())?;
    Ok(Live { description, plant, message: CString::default() })
}

impl Live {
    /// Does something, keeps why it did not go well, and says which it was as C does.
    fn told(&mut self, work: impl FnOnce(&mut Self) -> Result<(), String>) -> c_int {
        let said = guarded(|| work(self));
        self.message = spoken(said.as_ref().err().cloned().unwrap_or_default());
        c_int::from(said.is_err())
    }

    fn advance(&mut self, input: Input<f64>, duration: f64) -> Result<(), String> {
        let step = self.plant.step();
        let count = (duration / step).round();
        let is_whole = (count * step - duration).abs() <= 1e-6 * step;
        if !(is_whole && (1.0..=f64::from(u32::MAX)).contains(&count)) {
            let step_us = step * 1e6;
            return Err(format!(
                "{duration} s is no whole number of steps of {step_us} us (simulation.period_us)"
            ));
        }
        self.plant.advance(&input, count as u32).map_err(|e| e.to_string())
    }

    fn set(&mut self, assignment: &str) -> Result<(), String> {
        let mut changed = self.description.clone();
        changed.set(assignment).map_err(|e| listed(&e))?;
        self.plant.set_parameters(&changed).map_err(|e| e.to_string())?;
        self.description = changed;
        Ok(())
    }
}

/// See the header.
///
/// # Safety
///
/// `path` and `settings` are null or texts that end with a zero; `message` is null or has room for `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_open(
    path: *const c_char,
    settings: *const c_char,
    message: *mut c_char,
    size: usize,
) -> *mut Live {
    let made = guarded(|| {
        // SAFETY: both are null or texts that end, by this function's own condition
        let (path, settings) = unsafe { (heard(path)?, heard(settings)?) };
        opened(path, settings)
    });
    match made {
        Ok(live) => Box::into_raw(Box::new(live)),
        Err(reason) => {
            let reason = spoken(reason);
            let count = reason.as_bytes().len().min(size.saturating_sub(1));
            if !message.is_null() && size > 0 {
                // SAFETY: there is room for `size` bytes, of which `count` and the zero behind are no more; the reason is
                // memory of our own and does not overlap
                unsafe {
                    message.copy_from_nonoverlapping(reason.as_ptr(), count);
                    message.add(count).write(0);
                }
            }
            null_mut()
        }
    }
}

/// See the header.
///
/// # Safety
///
/// `crane` is null or from [`hydroboom_open`], not closed, and used by this thread alone for now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_advance(
    crane: *mut Live,
    pump_speed_rev_s: f64,
    holding_valve: f64,
    duration_s: f64,
) -> c_int {
    // SAFETY: null, or a crane of ours that nobody else uses, by this function's own condition
    let Some(live) = (unsafe { crane.as_mut() }) else { return 1 };
    live.told(|l| l.advance(Input { pump_speed: pump_speed_rev_s, holding_valve }, duration_s))
}

/// See the header.
///
/// # Safety
///
/// As for [`hydroboom_advance`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_time(crane: *const Live) -> f64 {
    // SAFETY: as in `hydroboom_advance`
    unsafe { crane.as_ref() }.map_or(f64::NAN, |live| live.plant.time())
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn hydroboom_output_count() -> usize {
    Outputs::NAMES.len()
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn hydroboom_output_name(output: usize) -> *const c_char {
    NAMES[0].get(output).map_or(null(), |name| name.as_ptr())
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn hydroboom_output_unit(output: usize) -> *const c_char {
    NAMES[1].get(output).map_or(null(), |unit| unit.as_ptr())
}

/// See the header.
///
/// # Safety
///
/// As for [`hydroboom_advance`]; `values` is null or has room for `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_read(
    crane: *const Live,
    values: *mut f64,
    count: usize,
) -> c_int {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_ref() }) else { return 1 };
    let Ok(seen) = guarded(|| Ok(live.plant.outputs().to_array())) else { return 1 };
    if values.is_null() || count < seen.len() {
        return 1;
    }
    // SAFETY: there is room for `count` numbers, which are no fewer than are seen
    unsafe { values.copy_from_nonoverlapping(seen.as_ptr(), seen.len()) };
    0
}

/// See the header.
///
/// # Safety
///
/// As for [`hydroboom_advance`]; `assignment` is null or a text that ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_set(crane: *mut Live, assignment: *const c_char) -> c_int {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_mut() }) else { return 1 };
    // SAFETY: null or a text that ends, by this function's own condition
    let assignment = unsafe { heard(assignment) };
    live.told(|l| l.set(assignment?.ok_or("there is nothing to set")?))
}

/// See the header.
///
/// # Safety
///
/// As for [`hydroboom_advance`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_message(crane: *const Live) -> *const c_char {
    // SAFETY: as in `hydroboom_advance`
    unsafe { crane.as_ref() }.map_or(c"there is no crane".as_ptr(), |live| live.message.as_ptr())
}

/// See the header.
///
/// # Safety
///
/// `crane` is null or from [`hydroboom_open`] and not closed; it is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_close(crane: *mut Live) {
    if !crane.is_null() {
        // SAFETY: it was made by `Box::into_raw` and is closed once, by this function's own condition
        drop(unsafe { Box::from_raw(crane) });
    }
}
