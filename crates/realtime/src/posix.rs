//! Services of a POSIX operating system for real-time threads: clock, scheduling, memory.
#![expect(unsafe_code, reason = "system calls; each is proven where it is made")]

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsRawFd;

/// Time of a clock \[ns\].
fn clock(id: libc::clockid_t) -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is a valid timespec to write to, and both clocks exist on every Linux.
    unsafe { libc::clock_gettime(id, &mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Monotonic time since an arbitrary origin \[ns\].
pub fn now() -> u64 {
    clock(libc::CLOCK_MONOTONIC)
}

/// Processor time of this thread \[ns\], without pre-emption by others.
pub fn thread_time() -> u64 {
    clock(libc::CLOCK_THREAD_CPUTIME_ID)
}

/// Sleeps until `spin` \[ns\] before the monotonic time `time` \[ns\], then polls the clock until `time`. A time in
/// the past returns at once. A sleeping thread wakes tens of microseconds late. A spinning thread is punctual, but
/// must leave the processor time for others.
pub fn wait_until(time: u64, spin: u64) {
    let wake = time.saturating_sub(spin);
    if now() < wake {
        let at = libc::timespec {
            tv_sec: (wake / 1_000_000_000) as libc::time_t,
            tv_nsec: (wake % 1_000_000_000) as libc::c_long,
        };
        let flags = libc::TIMER_ABSTIME;
        // SAFETY: `at` is a valid timespec; an absolute sleep writes no remainder, so null is allowed.
        // A signal that ends the sleep early only makes the spinning longer.
        unsafe { libc::clock_nanosleep(libc::CLOCK_MONOTONIC, flags, &at, std::ptr::null_mut()) };
    }
    while now() < time {
        std::hint::spin_loop();
    }
}

/// Pins the calling thread to one core, counted from 0.
///
/// # Errors
///
/// `InvalidInput` for a core beyond the size of a CPU set (1024 on Linux). Else the error of the operating system, as
/// for a core that is missing or not allowed.
pub fn pin_to(core: usize) -> io::Result<()> {
    // SAFETY: a cpu_set_t is a plain array of bits, for which zero is a valid value.
    let mut set: libc::cpu_set_t = unsafe { std::mem::zeroed() };
    if core >= libc::CPU_SETSIZE as usize {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "no such core"));
    }
    // SAFETY: `core` is within the set, which is valid; the size is that of the set.
    checked(unsafe {
        libc::CPU_SET(core, &mut set);
        libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set)
    })
}

/// Gives the calling thread the real-time scheduling class SCHED_FIFO, with a priority of 1 to 99.
///
/// # Errors
///
/// Error of the operating system: without privileges, that the call is not permitted; outside 1 to 99, that the
/// argument is invalid.
pub fn run_first(priority: i32) -> io::Result<()> {
    let parameter = libc::sched_param { sched_priority: priority };
    // SAFETY: `parameter` is valid; 0 is the calling thread.
    checked(unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameter) })
}

/// Locks all present and future memory of the process in RAM, so that no cycle waits for a page (`mlockall`).
///
/// # Errors
///
/// Error of the operating system: the limit of locked memory is exceeded, or the process has no privilege.
pub fn lock_memory() -> io::Result<()> {
    // SAFETY: no pointers are passed.
    checked(unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) })
}

/// Whether the process may lock all of its memory: it runs as root, or its limit RLIMIT_MEMLOCK is infinite.
pub fn may_lock_memory() -> bool {
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: `limit` is valid to write to; geteuid always succeeds.
    let (known, user) =
        unsafe { (libc::getrlimit(libc::RLIMIT_MEMLOCK, &mut limit) == 0, libc::geteuid()) };
    user == 0 || (known && limit.rlim_cur == libc::RLIM_INFINITY)
}

/// Effective user id of this process; 0 is root.
pub fn effective_user() -> u32 {
    // SAFETY: it has no arguments and always succeeds.
    unsafe { libc::geteuid() }
}

/// Sleeps until data can be read from a file descriptor, for at most the given time \[ns\]. A signal or an error ends
/// the sleep early, so that the next read decides whether data came.
pub fn wait_for_input(of: &impl AsRawFd, nanoseconds: u64) {
    let mut waited = libc::pollfd { fd: of.as_raw_fd(), events: libc::POLLIN, revents: 0 };
    let most = libc::timespec {
        tv_sec: (nanoseconds / 1_000_000_000) as libc::time_t,
        tv_nsec: (nanoseconds % 1_000_000_000) as libc::c_long,
    };
    // SAFETY: one valid entry, a valid time, no signal mask. The result is not needed: the next read shows
    // whether data came.
    unsafe { libc::ppoll(&mut waited, 1, &most, std::ptr::null()) };
}

/// Time that a hypervisor has taken from a core since boot \[s\], in steps of 10 ms; none if the kernel
/// does not report it.
pub fn stolen(core: usize) -> Option<f64> {
    // user, nice, system, idle, iowait, irq, softirq, steal: in hundredths of a second
    let statistics = std::fs::read_to_string("/proc/stat").ok()?;
    let name = format!("cpu{core}");
    let line = statistics.lines().find(|line| line.split_whitespace().next() == Some(&name))?;
    line.split_whitespace().nth(8)?.parse::<f64>().ok().map(|ticks| 0.01 * ticks)
}

/// Makes writing a file beyond the size limit an error instead of ending the process (SIGXFSZ).
pub fn survive_large_files() {
    // SAFETY: ignoring a signal runs no code of ours.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

/// Keeps the processor out of deep sleep states, whose exit latency is long, as long as the returned file
/// is open. It writes an allowed latency of 0 us to `/dev/cpu_dma_latency`.
///
/// # Errors
///
/// Error of the operating system: without privileges, that the call is not permitted; or that the file does not exist.
pub fn stay_awake() -> io::Result<File> {
    let mut file = File::options().write(true).open("/dev/cpu_dma_latency")?;
    file.write_all(&0_i32.to_ne_bytes())?;
    Ok(file)
}

fn checked(result: libc::c_int) -> io::Result<()> {
    match result {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}
