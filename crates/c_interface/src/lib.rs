//! A simulated crane as a C library; `include/hydroboom_live.h` documents each function.
//!
//! Null pointers, sizes and UTF-8 are checked. The validity of a non-null pointer is the caller's obligation, as
//! stated in the header.

#![expect(unsafe_code, reason = "functions for C are called with pointers")]

use hydroboom_description::{Description, DescriptionError, Problem};
use hydroboom_model::{Input, Outputs, Scheme};
use hydroboom_plant::{Plant, plant};
use std::ffi::{CStr, CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr::{null, null_mut};
use std::sync::LazyLock;

/// A simulated crane with its description.
struct Simulated {
    description: Description,
    plant: Box<dyn Plant>,
    /// Names of the states, with their units.
    state_names: Vec<CString>,
}

impl Simulated {
    /// A crane at rest at the initial position of its description.
    fn new(description: Description) -> Result<Self, String> {
        let n = &description.numbers;
        let start = description.start(n.motion_start);
        let plant = plant(&description, &start, Scheme::Published, n.simulation_period)
            .map_err(|e| e.to_string())?;
        let state_names = plant.state_names().into_iter().map(c_string).collect();
        Ok(Self { description, plant, state_names })
    }

    fn copied(&self) -> Self {
        Self {
            description: self.description.clone(),
            plant: self.plant.copied(),
            state_names: self.state_names.clone(),
        }
    }
}

/// The object behind the crane pointer of the C interface.
pub struct Live {
    crane: Simulated,
    message: CString,
}

/// A copy of a crane's state and description at one instant.
pub struct Saved(Simulated);

/// Names and units of the outputs, as C strings.
static NAMES: LazyLock<[Vec<CString>; 2]> =
    LazyLock::new(|| [Outputs::NAMES, Outputs::UNITS].map(|all| all.map(c_string).to_vec()));

/// Name (0) or unit (1) of an output; null for an index out of range.
fn listed_text(kind: usize, output: usize) -> *const c_char {
    let found = || NAMES.get(kind).and_then(|all| all.get(output)).map(|text| text.as_ptr());
    guarded(|| Ok(found().unwrap_or(null()))).unwrap_or(null())
}

/// Converts text to a C string; an inner zero byte, which would end it, becomes a space.
fn c_string(text: impl Into<String>) -> CString {
    CString::new(text.into().replace('\0', " ")).unwrap_or_default()
}

/// Borrows a C string as text; `None` for a null pointer.
///
/// # Safety
///
/// The pointer is null, or a zero-terminated text that does not change during `'a`.
unsafe fn borrowed_text<'a>(text: *const c_char) -> Result<Option<&'a str>, String> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: not null, and by this function's own condition zero-terminated
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map(Some).map_err(|_| "the text is not UTF-8".to_string())
}

/// Runs `work` and converts a panic to an error: unwinding into C is undefined behaviour.
fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err("a bug in Hydroboom: this call panicked".into()))
}

/// All errors of a crane file or a setting, with their remedies, as one text.
fn all_errors(error: &DescriptionError) -> String {
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
    .map_err(|e| all_errors(&e))?;
    for line in settings.unwrap_or_default().lines().filter(|line| !line.trim().is_empty()) {
        description.set(line.trim()).map_err(|e| all_errors(&e))?;
    }
    Ok(Live { crane: Simulated::new(description)?, message: CString::default() })
}

impl Live {
    /// Runs `work`, stores the message of a failure, and returns C's status: 0 for success, 1 for failure.
    fn run(&mut self, work: impl FnOnce(&mut Self) -> Result<(), String>) -> c_int {
        let outcome = guarded(|| work(self));
        self.message = c_string(outcome.as_ref().err().cloned().unwrap_or_default());
        c_int::from(outcome.is_err())
    }

    fn advance(&mut self, input: Input<f64>, duration: f64) -> Result<(), String> {
        let step = self.crane.plant.step();
        let count = (duration / step).round();
        let is_whole = (count * step - duration).abs() <= 1e-6 * step;
        if !(is_whole && (1.0..=f64::from(u32::MAX)).contains(&count)) {
            let step_us = step * 1e6;
            return Err(format!(
                "{duration} s is no whole number of steps of {step_us} us (simulation.period_us)"
            ));
        }
        self.crane.plant.advance(&input, count as u32).map_err(|e| e.to_string())
    }

    fn set(&mut self, assignment: &str) -> Result<(), String> {
        let mut changed = self.crane.description.clone();
        changed.set(assignment).map_err(|e| all_errors(&e))?;
        self.crane.plant.set_parameters(&changed).map_err(|e| e.to_string())?;
        self.crane.description = changed;
        Ok(())
    }

    /// Value of an output or a state by its name.
    fn value(&self, name: &str) -> Option<f64> {
        if let Some(k) = Outputs::NAMES.iter().position(|own| *own == name) {
            return self.crane.plant.outputs().to_array().get(k).copied();
        }
        let is_it = |own: &CString| own.as_bytes() == name.as_bytes();
        let k = self.crane.state_names.iter().position(is_it)?;
        self.crane.plant.state_vector().get(k).copied()
    }
}

/// Copies the values into the caller's buffer. Returns 0, or 1 if the buffer is null or too small.
///
/// # Safety
///
/// `values` is null or has room for `count` numbers.
unsafe fn put(seen: &[f64], values: *mut f64, count: usize) -> c_int {
    if values.is_null() || count < seen.len() {
        return 1;
    }
    // SAFETY: the buffer has room for `count` numbers, at least as many as are copied, and does not overlap
    unsafe { values.copy_from_nonoverlapping(seen.as_ptr(), seen.len()) };
    0
}

/// Opens a crane in equilibrium at the initial position of its file.
///
/// `path` is a crane file, or null for the paper's crane. `settings` has changed keys, one a line
/// (`payload.mass_kg=340`), or is null. On an error returns null and writes the reason to `message`, of `size` bytes.
///
/// # Safety
///
/// `path` and `settings` are null or zero-terminated; `message` is null or has room for `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_open(
    path: *const c_char,
    settings: *const c_char,
    message: *mut c_char,
    size: usize,
) -> *mut Live {
    let made = guarded(|| {
        // SAFETY: both are null or zero-terminated, by this function's own condition
        let (path, settings) = unsafe { (borrowed_text(path)?, borrowed_text(settings)?) };
        opened(path, settings)
    });
    match made {
        Ok(live) => Box::into_raw(Box::new(live)),
        Err(reason) => {
            let reason = c_string(reason);
            let count = reason.as_bytes().len().min(size.saturating_sub(1));
            if !message.is_null() && size > 0 {
                // SAFETY: the buffer has room for `size` bytes, at least `count` and the final zero, and does not
                // overlap with the message
                unsafe {
                    message.copy_from_nonoverlapping(reason.as_ptr(), count);
                    message.add(count).write(0);
                }
            }
            null_mut()
        }
    }
}

/// Simulates `duration_s` \[s\], a whole number of the crane file's simulation periods, under constant inputs.
///
/// `pump_speed_rev_s` is the pump speed \[rev/s\], positive for lifting; `holding_valve` the 3/2 valve (1 energised,
/// 0 load held). Returns 0 for success, 1 for an error.
///
/// # Safety
///
/// `crane` is null or from [`hydroboom_open`], not closed, and not used by another thread during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_advance(
    crane: *mut Live,
    pump_speed_rev_s: f64,
    holding_valve: f64,
    duration_s: f64,
) -> c_int {
    // SAFETY: null, or a valid crane that no other thread uses, by this function's own condition
    let Some(live) = (unsafe { crane.as_mut() }) else { return 1 };
    live.run(|l| l.advance(Input { pump_speed: pump_speed_rev_s, holding_valve }, duration_s))
}

/// Time since the start \[s\]; NaN for a null pointer.
///
/// # Safety
///
/// As for [`hydroboom_advance`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_time(crane: *const Live) -> f64 {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_ref() }) else { return f64::NAN };
    guarded(|| Ok(live.crane.plant.time())).unwrap_or(f64::NAN)
}

/// Number of outputs.
#[unsafe(no_mangle)]
pub extern "C" fn hydroboom_output_count() -> usize {
    Outputs::NAMES.len()
}

/// Name of an output by its index from 0; null for an index out of range.
#[unsafe(no_mangle)]
pub extern "C" fn hydroboom_output_name(output: usize) -> *const c_char {
    listed_text(0, output)
}

/// Unit of an output by its index from 0; null for an index out of range.
#[unsafe(no_mangle)]
pub extern "C" fn hydroboom_output_unit(output: usize) -> *const c_char {
    listed_text(1, output)
}

/// Writes all outputs to `values`, with room for `count` numbers. Returns 0 for success, 1 for an error.
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
    let Ok(seen) = guarded(|| Ok(live.crane.plant.outputs().to_array())) else { return 1 };
    // SAFETY: null or room for `count` numbers, by this function's own condition
    unsafe { put(&seen, values, count) }
}

/// Number of states, which depends on the crane's number of segments; 0 for a null pointer.
///
/// # Safety
///
/// As for [`hydroboom_advance`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_state_count(crane: *const Live) -> usize {
    // SAFETY: as in `hydroboom_advance`
    unsafe { crane.as_ref() }.map_or(0, |live| live.crane.state_names.len())
}

/// Name of a state with its unit (`pressure_a_pa`), by its index from 0; null for an index out of range. It is valid
/// until the crane is reset, restored or closed.
///
/// # Safety
///
/// As for [`hydroboom_advance`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_state_name(crane: *const Live, state: usize) -> *const c_char {
    // SAFETY: as in `hydroboom_advance`
    let live = unsafe { crane.as_ref() };
    live.and_then(|live| live.crane.state_names.get(state)).map_or(null(), |name| name.as_ptr())
}

/// Writes all states to `values`, with room for `count` numbers. Returns 0 for success, 1 for an error.
///
/// # Safety
///
/// As for [`hydroboom_advance`]; `values` is null or has room for `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_read_states(
    crane: *const Live,
    values: *mut f64,
    count: usize,
) -> c_int {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_ref() }) else { return 1 };
    let Ok(seen) = guarded(|| Ok(live.crane.plant.state_vector())) else { return 1 };
    // SAFETY: null or room for `count` numbers, by this function's own condition
    unsafe { put(&seen, values, count) }
}

/// Writes one output (`pressure_a`) or state (`pressure_a_pa`), by its name, to `value`. Returns 0 for success, 1 for
/// an error.
///
/// # Safety
///
/// As for [`hydroboom_advance`]; `name` is null or zero-terminated; `value` is null or has room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_value(
    crane: *const Live,
    name: *const c_char,
    value: *mut f64,
) -> c_int {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_ref() }) else { return 1 };
    // SAFETY: null or zero-terminated, by this function's own condition
    let Ok(Some(name)) = (unsafe { borrowed_text(name) }) else { return 1 };
    let Ok(Some(found)) = guarded(|| Ok(live.value(name))) else { return 1 };
    // SAFETY: null or room for a number, by this function's own condition
    unsafe { put(&[found], value, 1) }
}

/// Returns to equilibrium at the crane file's initial position and to time 0, with the current keys. Returns 0 for
/// success, 1 for an error; the crane is then unchanged.
///
/// # Safety
///
/// As for [`hydroboom_advance`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_reset(crane: *mut Live) -> c_int {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_mut() }) else { return 1 };
    live.run(|l| {
        l.crane = Simulated::new(l.crane.description.clone())?;
        Ok(())
    })
}

/// Saves state, time and keys; null on an error. Release the copy with [`hydroboom_release`].
///
/// # Safety
///
/// As for [`hydroboom_advance`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_save(crane: *const Live) -> *mut Saved {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_ref() }) else { return null_mut() };
    guarded(|| Ok(Box::into_raw(Box::new(Saved(live.crane.copied()))))).unwrap_or(null_mut())
}

/// Restores a saved copy, to any crane, which continues exactly as the saved one. Returns 0 for success, 1 for an
/// error.
///
/// # Safety
///
/// As for [`hydroboom_advance`]; `saved` is null or from [`hydroboom_save`] and not released.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_restore(crane: *mut Live, saved: *const Saved) -> c_int {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_mut() }) else { return 1 };
    // SAFETY: null, or from `hydroboom_save` and not released, by this function's own condition
    let saved = unsafe { saved.as_ref() };
    live.run(|l| {
        l.crane = saved.ok_or("there is no saved state")?.0.copied();
        Ok(())
    })
}

/// Releases a saved copy.
///
/// # Safety
///
/// `saved` is null or from [`hydroboom_save`] and not released; it must not be used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_release(saved: *mut Saved) {
    if !saved.is_null() {
        // SAFETY: made by `Box::into_raw` and released once, by this function's own condition
        let saved = unsafe { Box::from_raw(saved) };
        // this function has no way to report an error
        let _ = guarded(move || {
            drop(saved);
            Ok(())
        });
    }
}

/// Sets a key of the crane file during the simulation (`payload.mass_kg=120`). Returns 0 for success, 1 for an error.
///
/// # Safety
///
/// As for [`hydroboom_advance`]; `assignment` is null or zero-terminated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_set(crane: *mut Live, assignment: *const c_char) -> c_int {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_mut() }) else { return 1 };
    // SAFETY: null or zero-terminated, by this function's own condition
    let assignment = unsafe { borrowed_text(assignment) };
    live.run(|l| l.set(assignment?.ok_or("there is nothing to set")?))
}

/// Error text of the last call on this crane; empty after success. It is valid until the next call on the crane.
///
/// # Safety
///
/// As for [`hydroboom_advance`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_message(crane: *const Live) -> *const c_char {
    // SAFETY: as in `hydroboom_advance`
    unsafe { crane.as_ref() }.map_or(c"there is no crane".as_ptr(), |live| live.message.as_ptr())
}

/// Closes a crane.
///
/// # Safety
///
/// `crane` is null or from [`hydroboom_open`] and not closed; it must not be used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_close(crane: *mut Live) {
    if !crane.is_null() {
        // SAFETY: made by `Box::into_raw` and closed once, by this function's own condition
        let live = unsafe { Box::from_raw(crane) };
        // this function has no way to report an error
        let _ = guarded(move || {
            drop(live);
            Ok(())
        });
    }
}
