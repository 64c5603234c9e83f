//! Generated C on a microcontroller (Cortex-M4F in an emulator) against Rust.
//!
//! Needs `arm-none-eabi-gcc` with newlib and `qemu-system-arm` (Debian: gcc-arm-none-eabi, libnewlib-arm-none-eabi,
//! qemu-system-arm); says that it is skipped where they are absent.

use hydroboom_description::Description;
use hydroboom_export::c::{Precision, files};
use hydroboom_export::crane_model;
use hydroboom_model::Input;
use hydroboom_model::stepping::published;
use std::path::PathBuf;
use std::process::Command;

const STEPS: u32 = 2000;

fn has(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|o| o.status.success())
}

/// Linker script: vector table and memory of the emulated board (mps2-an386).
const LINKER: &str = "\
MEMORY { FLASH (rx) : ORIGIN = 0x00000000, LENGTH = 4M  RAM (rwx) : ORIGIN = 0x20000000, LENGTH = 4M }
SECTIONS {
    .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) } > FLASH
    .ARM.exidx : { *(.ARM.exidx*) } > FLASH
    .data : { *(.data*) } > RAM
    .bss : { *(.bss*) *(COMMON) } > RAM
    end = .;
    stack_top = 0x20400000;
}
";

/// Start-up without the library's code: enables the floating-point unit, steps the model, and prints the state's bits
/// by semihosting.
const MAIN: &str = r#"
#include "crane.h"
#include <stdint.h>
#include <string.h>

extern uint32_t stack_top;
void start(void);
__attribute__((section(".vectors"), used)) static void *const vectors[] = { &stack_top, (void *)start };

static int ask(int operation, const void *block)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = block;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void say(uint64_t bits)
{
    char text[18];
    int k;
    for (k = 0; k < 16; k++) {
        text[k] = "0123456789abcdef"[(bits >> (60 - 4 * k)) & 15U];
    }
    text[16] = '\n';
    text[17] = '\0';
    (void)ask(4, text);
}

static void __attribute__((noinline)) work(void)
{
    static hb_model_parameters p;
    static hb_model_prepared c;
    static hb_model_state s;
    static hb_model_input u;
    const double *values = (const double *)&s;
    unsigned k;
    hb_model_describe(&p);
    hb_model_prepare(&p, &c);
    hb_model_start(&s);
    u.step = 50e-6;
    for (k = 0; k < STEPS; k++) {
        u.pump_speed = 0.005 * (double)k;
        u.holding_valve = (k < 1500U) ? 1.0 : 0.0;
        hb_model_step(&c, &s, &u);
    }
    for (k = 0; k < sizeof s / sizeof *values; k++) {
        uint64_t bits;
        memcpy(&bits, &values[k], sizeof bits);
        say(bits);
    }
    {
        static const uint32_t ended[2] = { 0x20026, 0 };
        (void)ask(0x18, (const void *)ended[0]);
    }
}

void start(void)
{
    /* before anything that uses it */
    *(volatile uint32_t *)0xE000ED88 |= 0xFU << 20;
    __asm__ volatile("dsb\nisb");
    work();
    for (;;) {
    }
}
"#;

#[test]
fn a_microcontroller_computes_the_same_to_the_last_bit() {
    let needed = ["arm-none-eabi-gcc", "qemu-system-arm"];
    if let Some(absent) = needed.into_iter().find(|program| !has(program)) {
        eprintln!("skipped: {absent} is not on the PATH");
        return;
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("cortex-m");
    std::fs::create_dir_all(&folder).unwrap();
    let description = Description::uia_single_boom().unwrap();
    let made = files(&[crane_model(&description).unwrap()], "crane", Precision::Double).unwrap();
    let main = MAIN.replace("STEPS", &format!("{STEPS}U"));
    for (name, content) in [
        ("crane.h", made.header.as_str()),
        ("crane.c", &made.source),
        ("main.c", &main),
        ("crane.ld", LINKER),
    ] {
        std::fs::write(folder.join(name), content).unwrap();
    }
    let output = Command::new("arm-none-eabi-gcc")
        .current_dir(&folder)
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-ffp-contract=off"])
        // the fma of newlib rounds twice
        .arg("-DHB_SOFT_FMA")
        .args(["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"])
        .args(["-nostartfiles", "-T", "crane.ld", "crane.c", "main.c", "-lm", "-o", "crane.elf"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = Command::new("qemu-system-arm")
        .current_dir(&folder)
        .args(["-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel", "crane.elf"])
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&output.stdout).into_owned()
        + &String::from_utf8_lossy(&output.stderr);
    let found: Vec<u64> =
        printed.lines().filter_map(|l| u64::from_str_radix(l.trim(), 16).ok()).collect();

    let crane = description.crane::<3>().unwrap();
    let n = &description.numbers;
    let mut state = crane.at_rest(&description.start_over(n, n.motion_start)).unwrap();
    for k in 0..STEPS {
        let holding_valve = if k < 1500 { 1.0 } else { 0.0 };
        let input = Input { pump_speed: 0.005 * f64::from(k), holding_valve };
        published(&crane, &mut state, &input, 50e-6);
    }
    let boom = &state.boom;
    let nodes = state.circuit.nodes.to_array();
    let parts = [
        &boom.angle[..],
        &boom.angular_velocity,
        &[state.bristle],
        &nodes,
        &[state.circuit.gas_volume],
    ];
    let wanted: Vec<u64> = parts.concat().into_iter().map(f64::to_bits).collect();
    assert_eq!(found, wanted, "{printed}");
}
