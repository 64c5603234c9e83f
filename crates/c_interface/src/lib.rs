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

/// A crane with all that it is described by.
struct Simulated {
    description: Description,
    plant: Box<dyn Plant>,
    /// Names of its states, with their units.
    state_names: Vec<CString>,
}

impl Simulated {
    /// A crane at rest where its description starts.
    fn new(description: Description) -> Result<Self, String> {
        let n = &description.numbers;
        let start = description.start(n.motion_start);
        let plant = plant(&description, &start, Scheme::Published, n.simulation_period)
            .map_err(|e| e.to_string())?;
        let state_names = plant.state_names().into_iter().map(spoken).collect();
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

/// A crane that C holds a pointer to.
pub struct Live {
    crane: Simulated,
    message: CString,
}

/// A crane as it was when it was saved.
pub struct Saved(Simulated);

/// Names and units of what can be seen, as C reads them.
static NAMES: LazyLock<[Vec<CString>; 2]> =
    LazyLock::new(|| [Outputs::NAMES, Outputs::UNITS].map(|all| all.map(spoken).to_vec()));

/// Name (0) or unit (1) of an output; null beyond the last.
fn listed_text(kind: usize, output: usize) -> *const c_char {
    let found = || NAMES.get(kind).and_then(|all| all.get(output)).map(|text| text.as_ptr());
    guarded(|| Ok(found().unwrap_or(null()))).unwrap_or(null())
}

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
    Ok(Live { crane: Simulated::new(description)?, message: CString::default() })
}

impl Live {
    /// Does something, keeps why it did not go well, and says which it was as C does.
    fn told(&mut self, work: impl FnOnce(&mut Self) -> Result<(), String>) -> c_int {
        let said = guarded(|| work(self));
        self.message = spoken(said.as_ref().err().cloned().unwrap_or_default());
        c_int::from(said.is_err())
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
        changed.set(assignment).map_err(|e| listed(&e))?;
        self.crane.plant.set_parameters(&changed).map_err(|e| e.to_string())?;
        self.crane.description = changed;
        Ok(())
    }

    /// An output or a state by its name.
    fn value(&self, name: &str) -> Option<f64> {
        if let Some(k) = Outputs::NAMES.iter().position(|own| *own == name) {
            return self.crane.plant.outputs().to_array().get(k).copied();
        }
        let is_it = |own: &CString| own.as_bytes() == name.as_bytes();
        let k = self.crane.state_names.iter().position(is_it)?;
        self.crane.plant.state_vector().get(k).copied()
    }
}

/// Numbers put where a caller has room for them: 0, or 1 where there is none.
///
/// # Safety
///
/// `values` is null or has room for `count` numbers.
unsafe fn put(seen: &[f64], values: *mut f64, count: usize) -> c_int {
    if values.is_null() || count < seen.len() {
        return 1;
    }
    // SAFETY: there is room for `count` numbers, which are no fewer than are seen; what is seen is memory of our own
    unsafe { values.copy_from_nonoverlapping(seen.as_ptr(), seen.len()) };
    0
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
    let Some(live) = (unsafe { crane.as_ref() }) else { return f64::NAN };
    guarded(|| Ok(live.crane.plant.time())).unwrap_or(f64::NAN)
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn hydroboom_output_count() -> usize {
    Outputs::NAMES.len()
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn hydroboom_output_name(output: usize) -> *const c_char {
    listed_text(0, output)
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn hydroboom_output_unit(output: usize) -> *const c_char {
    listed_text(1, output)
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
    let Ok(seen) = guarded(|| Ok(live.crane.plant.outputs().to_array())) else { return 1 };
    // SAFETY: null or room for `count` numbers, by this function's own condition
    unsafe { put(&seen, values, count) }
}

/// See the header.
///
/// # Safety
///
/// As for [`hydroboom_advance`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_state_count(crane: *const Live) -> usize {
    // SAFETY: as in `hydroboom_advance`
    unsafe { crane.as_ref() }.map_or(0, |live| live.crane.state_names.len())
}

/// See the header.
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

/// See the header.
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

/// See the header.
///
/// # Safety
///
/// As for [`hydroboom_advance`]; `name` is null or a text that ends with a zero; `value` is null or has room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_value(
    crane: *const Live,
    name: *const c_char,
    value: *mut f64,
) -> c_int {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_ref() }) else { return 1 };
    // SAFETY: null or a text that ends, by this function's own condition
    let Ok(Some(name)) = (unsafe { heard(name) }) else { return 1 };
    let Ok(Some(found)) = guarded(|| Ok(live.value(name))) else { return 1 };
    // SAFETY: null or room for a number, by this function's own condition
    unsafe { put(&[found], value, 1) }
}

/// See the header.
///
/// # Safety
///
/// As for [`hydroboom_advance`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_reset(crane: *mut Live) -> c_int {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_mut() }) else { return 1 };
    live.told(|l| {
        l.crane = Simulated::new(l.crane.description.clone())?;
        Ok(())
    })
}

/// See the header.
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

/// See the header.
///
/// # Safety
///
/// As for [`hydroboom_advance`]; `saved` is null or from [`hydroboom_save`] and not released.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_restore(crane: *mut Live, saved: *const Saved) -> c_int {
    // SAFETY: as in `hydroboom_advance`
    let Some(live) = (unsafe { crane.as_mut() }) else { return 1 };
    // SAFETY: null, or saved by us and not released, by this function's own condition
    let saved = unsafe { saved.as_ref() };
    live.told(|l| {
        l.crane = saved.ok_or("there is no saved state")?.0.copied();
        Ok(())
    })
}

/// See the header.
///
/// # Safety
///
/// `saved` is null or from [`hydroboom_save`] and not released; it is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hydroboom_release(saved: *mut Saved) {
    if !saved.is_null() {
        // SAFETY: it was made by `Box::into_raw` and is released once, by this function's own condition
        let saved = unsafe { Box::from_raw(saved) };
        // nothing could be told of it here
        let _ = guarded(move || {
            drop(saved);
            Ok(())
        });
    }
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
        let live = unsafe { Box::from_raw(crane) };
        // nothing could be told of it here
        let _ = guarded(move || {
            drop(live);
            Ok(())
        });
    }
}
