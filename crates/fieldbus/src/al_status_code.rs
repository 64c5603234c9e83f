//! AL status codes: why a device refused or left a state of the EtherCAT state machine, and what to do.
//!
//! Numbers of register 0x0134 by ETG.1000.6 (table of AL status codes) and ETG.1020; 0x002E is defined by ETG.1020
//! only. Causes and advice are in terms of the table and of this program's start-up.

/// Cause and advice of an AL status code. Each completes a sentence, without a final stop.
#[derive(Debug)]
pub(crate) struct Explanation {
    /// AL status code, register 0x0134.
    code: u16,
    /// Why the device refused or left the state.
    pub(crate) cause: &'static str,
    /// What to do.
    pub(crate) advice: &'static str,
}

/// Explanation of an AL status code; codes that are not listed share one that points to the manual, and 0 has one of
/// its own.
pub(crate) fn explanation(code: u16) -> &'static Explanation {
    if code == 0 {
        return &NO_CODE;
    }
    EXPLANATIONS.iter().find(|listed| listed.code == code).unwrap_or(&NOT_LISTED)
}

/// Shorthand for the rows below.
const fn explain(code: u16, cause: &'static str, advice: &'static str) -> Explanation {
    Explanation { code, cause, advice }
}

/// Of code 0: no error, or a code that could not be read.
static NO_CODE: Explanation = explain(
    0,
    "it reports no error, or its AL status code could not be read",
    "check whether it was switched off, and its cable",
);

/// Of every code that is not listed, as those of mailbox protocols (0x0041 to 0x004F), and those from 0x8000 on, which
/// are the manufacturer's.
static NOT_LISTED: Explanation = explain(
    0,
    "this program has no explanation of this code",
    "read the code in the manual of the device, and its own error display",
);

/// The listed codes, in ascending order.
static EXPLANATIONS: &[Explanation] = &[
    explain(
        0x0001,
        "an error without a code of its own occurred",
        "read its error display or its diagnosis messages (0x10F3), and remove that error",
    ),
    explain(
        0x0002,
        "its application has no memory left",
        "map fewer objects into its PDOs, then switch its supply off and on",
    ),
    explain(
        0x0003,
        "its modules or parameters do not fit its set-up",
        "compare its modules and parameters with those that were set up with its manufacturer's configuration tool",
    ),
    explain(
        0x0011,
        "the requested state cannot follow on its present one",
        "end other main devices on the bus, then repeat: states follow from INIT over PREOP and SAFEOP to OP",
    ),
    explain(
        0x0012,
        "AL control (0x0120) was written with a number that is no state",
        "look for another main device that writes to its registers, and end it",
    ),
    explain(
        0x0013,
        "bootstrap was requested, which it does not support",
        "end the program that loads firmware into it, and load firmware as its manual says",
    ),
    explain(0x0014, "it has no valid firmware", "load firmware into it"),
    explain(
        0x0015,
        "the sync managers of its mailbox are not those that it expects in bootstrap",
        "correct the bootstrap mailbox in its EEPROM (words 0x14 to 0x17), or load firmware with its manufacturer's \
        configuration tool",
    ),
    explain(
        0x0016,
        "the sync managers of its mailbox are not those that it expects in PREOP",
        "its EEPROM (words 0x18 to 0x1B) does not fit its firmware: load both of one release",
    ),
    explain(
        0x0017,
        "a sync manager has an address, a direction or a mode that it does not accept",
        "compare the sync managers in its EEPROM (category 41) with its manual, and load the EEPROM anew",
    ),
    explain(
        0x0018,
        "its application has no valid inputs",
        "check its sensors with their supply and wiring, and its error display",
    ),
    explain(
        0x0019,
        "it received no valid outputs before OP",
        "check that the table has all its outputs, and that their frames have the right working counter",
    ),
    explain(
        0x001a,
        "the synchronisation of its outputs and SYNC0 was lost",
        "check the margins of frames before SYNC0, then what delays this computer (hydroboom doctor)",
    ),
    explain(
        0x001b,
        "no outputs arrived within its process-data watchdog",
        "find out why frames stopped: the program ended, it was late, or a cable was pulled; or raise watchdog_ms",
    ),
    explain(
        0x001c,
        "a sync manager has a type (0x1C00) that does not fit its use",
        "its types in 0x1C00 have to be those in its EEPROM: load EEPROM and firmware that belong together",
    ),
    explain(
        0x001d,
        "the sync manager of its outputs does not have the address or the length of the mapped outputs",
        "correct its outputs in the table: their bits have to be those of 0x1C12",
    ),
    explain(
        0x001e,
        "the sync manager of its inputs does not have the address or the length of the mapped inputs",
        "correct its inputs in the table: their bits have to be those of 0x1C13",
    ),
    explain(
        0x001f,
        "its watchdog has a time that it does not accept, or is not triggered by outputs",
        "set watchdog_ms of the table to what its manual asks for",
    ),
    explain(0x0020, "it needs a cold start", "switch its supply off and on"),
    explain(
        0x0021,
        "its application asks for INIT",
        "start the bus again, which begins in INIT; if it asks again, read its error display",
    ),
    explain(
        0x0022,
        "its application asks for PREOP, as after a changed parameter",
        "start the bus again, so that its start-up SDOs are written anew",
    ),
    explain(
        0x0023,
        "its application asks for SAFEOP",
        "read in its manual why its outputs may not operate, such as a missing power supply or enable input",
    ),
    explain(
        0x0024,
        "the mapped inputs are not ones that it allows",
        "map inputs that its manual allows (0x1C13, 0x1A00 and up)",
    ),
    explain(
        0x0025,
        "the mapped outputs are not ones that it allows",
        "map outputs that its manual allows (0x1C12, 0x1600 and up)",
    ),
    explain(
        0x0026,
        "its settings contradict each other",
        "compare its start-up SDOs in the table with its manual: mode, mapping and synchronisation together",
    ),
    explain(0x0027, "free run is not supported", "set sync = \"sync0\" in the table"),
    explain(
        0x0028,
        "it does not support the synchronisation that is set up",
        "set sync and the start-up SDO of 0x1C32:01 to a type that it supports (0x1C32:04)",
    ),
    explain(
        0x0029,
        "it supports free run only with three buffers for its process data, and a sync manager has one",
        "set the sync manager to buffered mode in its EEPROM, or use sync = \"sync0\"",
    ),
    explain(
        0x002a,
        "the watchdog of its own application expired",
        "switch its supply off and on, and load a newer firmware if it occurs again",
    ),
    explain(
        0x002b,
        "it has neither valid inputs nor valid outputs",
        "check its modules with their supply, then both lists of PDOs in the table",
    ),
    explain(
        0x002c,
        "SYNC0 or SYNC1 is no longer received",
        "start the bus again; if it occurs again, check its supply, as a restart of its controller ends SYNC0",
    ),
    explain(
        0x002d,
        "no SYNC0 was received",
        "check that sync in the table is the mode that it is set up for (0x1C32:01)",
    ),
    explain(
        0x002e,
        "the cycle is shorter than it can follow",
        "raise bus.period_us and the control period to its shortest cycle (0x1C32:05) or more",
    ),
    explain(
        0x002f,
        "ETG.1000.6 reserves this code, and its manufacturer has given it a meaning",
        "ask its manufacturer about the code, with the version of its software (0x100A)",
    ),
    explain(
        0x0030,
        "its SYNC unit (0x0980, 0x0981) is not activated as its application is set up",
        "set sync, 0x1C32:01 and 0x1C33:01 as its manual asks for",
    ),
    explain(
        0x0031,
        "the latch unit of its clock has settings that it does not accept",
        "delete start-up SDOs that set up a touch probe or latch inputs",
    ),
    explain(
        0x0032,
        "PLL error: SYNC events come, but the frames are not synchronised to them",
        "check the phase and the jitter of the exchanges, then its clock difference (0x092C)",
    ),
    explain(
        0x0033,
        "its inputs or outputs are not transferred in synchronism with SYNC0",
        "send outputs earlier before SYNC0 (lower bus.send_us), and read the meaning of 0x1C32:06 in its manual",
    ),
    explain(
        0x0034,
        "too many output frames (SM events) were missed",
        "reduce lost and late frames, raise its limit (0x10F1:02), or raise bus.period_us",
    ),
    explain(
        0x0035,
        "the cycle of its synchronisation is not one that it supports",
        "set bus.period_us to a cycle that its manual lists",
    ),
    explain(
        0x0036,
        "the cycle of SYNC0 (0x09A0) is not one that it supports",
        "set bus.period_us to a multiple of its base cycle",
    ),
    explain(
        0x0037,
        "the cycle of SYNC1 (0x09A4) is not one that it supports",
        "set sync1_us of the table to a cycle that fits bus.period_us by its manual",
    ),
    explain(
        0x0050,
        "its application has no access to its EEPROM",
        "switch its supply off and on, so that no main device holds the EEPROM (0x0500)",
    ),
    explain(
        0x0051,
        "its EEPROM cannot be read",
        "load its EEPROM anew; if that does not help, have it repaired",
    ),
    explain(
        0x0060,
        "it restarted by itself",
        "check its supply for dips, then start the bus again",
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_code_of_the_state_machine_has_a_cause_and_an_advice_of_its_own() {
        for code in 0x0011..=0x0037 {
            assert_eq!(explanation(code).code, code, "{code:#06x} is not listed");
        }
        let different = |text: fn(&Explanation) -> &'static str| {
            EXPLANATIONS.iter().map(text).collect::<BTreeSet<_>>().len()
        };
        assert_eq!(different(|listed| listed.cause), EXPLANATIONS.len());
        assert_eq!(different(|listed| listed.advice), EXPLANATIONS.len());
        assert!(EXPLANATIONS.is_sorted_by_key(|listed| listed.code));
        // vendor-specific codes
        assert!(explanation(0x8001).advice.contains("manual"));
        // listed by ETG.1020, without an explanation here: mailboxes, restart of the controller
        for code in [0x0041, 0x004f, 0x0061, 0x00f0] {
            assert!(explanation(code).cause.contains("no explanation"), "{code:#06x}");
        }
        assert!(explanation(0).cause.contains("no error") && explanation(0).code == 0);
    }

    #[test]
    fn causes_and_advice_are_single_sentences_of_less_than_thirty_words() {
        for listed in EXPLANATIONS.iter().chain([&NO_CODE, &NOT_LISTED]) {
            for text in [listed.cause, listed.advice] {
                assert!(text.split_whitespace().count() < 30, "{text}");
                assert!(!text.ends_with('.') && text.lines().count() == 1, "{text}");
            }
        }
    }
}
