//! Check of the computer's real-time capability: findings, and advice for what is missing.

use crate::posix;
use std::path::Path;

/// Result of one check.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Checked property.
    pub what: &'static str,
    /// Observed value.
    pub found: String,
    /// Whether the value suits a real-time program.
    pub is_well: bool,
    /// Advice, with the reason, if the value does not suit.
    pub advice: &'static str,
}

fn finding(what: &'static str, found: String, is_well: bool, advice: &'static str) -> Finding {
    Finding { what, found, is_well, advice }
}

fn read(path: &str) -> Option<String> {
    std::fs::read_to_string(path).ok().map(|text| text.trim().to_string())
}

/// Checks this computer: cores, kernel, hypervisor, real-time priority, memory lock, throttling, frequency governor,
/// sleep states, isolated cores. What cannot be read counts as unsuitable, except a missing governor. Nothing is
/// changed beyond the call.
pub fn examine() -> Vec<Finding> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let version = read("/proc/sys/kernel/version").unwrap_or_default();
    let preempts =
        read("/sys/kernel/realtime").as_deref() == Some("1") || version.contains("PREEMPT_RT");
    let throttle = read("/proc/sys/kernel/sched_rt_runtime_us");
    let governor = read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
    let isolated = read("/sys/devices/system/cpu/isolated").filter(|cores| !cores.is_empty());
    let hypervisor = read("/proc/cpuinfo").is_some_and(|text| text.contains(" hypervisor"));
    // in a thread of its own, so that the priority ends with the thread
    let first = std::thread::spawn(|| posix::run_first(80)).join();
    let may_run_first = matches!(first, Ok(Ok(())));
    let may_lock = posix::may_lock_memory();
    vec![
        finding(
            "cores",
            cores.to_string(),
            cores >= 3,
            "one each for simulation and control, and one for all else: with two, the machine's process, \
             the log and the system share the control task's core",
        ),
        finding(
            "kernel",
            if preempts { "PREEMPT_RT".into() } else { version.clone() },
            preempts,
            "install a PREEMPT_RT kernel (Debian: linux-image-rt-amd64): others delay a task by \
             milliseconds now and then",
        ),
        finding(
            "hypervisor",
            if hypervisor { "yes: a virtual machine" } else { "no" }.into(),
            !hypervisor,
            "run on the bare machine: a hypervisor takes the processor away without a word",
        ),
        finding(
            "real-time priority",
            if may_run_first { "granted" } else { "refused" }.into(),
            may_run_first,
            "run as root, or grant it: `@realtime - rtprio 90` in /etc/security/limits.conf",
        ),
        finding(
            "memory lock",
            if may_lock { "granted" } else { "refused" }.into(),
            may_lock,
            "run as root, or grant it: `@realtime - memlock unlimited` in /etc/security/limits.conf",
        ),
        finding(
            "real-time throttling",
            throttle.clone().map_or("unknown".into(), |us| format!("{us} us of 1 s")),
            throttle.as_deref() == Some("-1"),
            "the kernel stops real-time tasks for the rest of each second; ours sleep enough not to be \
             stopped. `sysctl kernel.sched_rt_runtime_us=-1` takes the limit away, for all programs",
        ),
        finding(
            "frequency governor",
            governor.clone().unwrap_or_else(|| "none, or the host's".into()),
            governor.as_deref().is_none_or(|name| name == "performance"),
            "`cpupower frequency-set -g performance`: a slow clock makes steps late",
        ),
        finding(
            "deep sleep",
            if Path::new("/dev/cpu_dma_latency").exists() { "can be kept off" } else { "cannot" }
                .into(),
            posix::stay_awake().is_ok(),
            "let the user write /dev/cpu_dma_latency: a processor that sleeps deeply wakes late",
        ),
        finding(
            "isolated cores",
            isolated.clone().unwrap_or_else(|| "none".into()),
            isolated.is_some(),
            "boot with isolcpus=1 nohz_full=1: then nothing else runs beside the simulation",
        ),
    ]
}
