//! Listening: frames as in operation while devices are in SAFEOP, and their times.

use super::facts::{Listening, Percentiles};
use crate::bus::MARGIN;
use crate::fault::LossWindow;
use crate::link::Link;
use crate::pace::Pace;
use crate::start_up::{Devices, exchange_until_sync0};
use crate::statistics::Times;
use crate::table::Table;
use crate::time::now;
use crate::wire::Wire;
use ethercrab::subdevice_group::SafeOp;

/// Number of cycles that are measured.
const CYCLES: u64 = 500;

/// Times and working counter of one exchange.
struct ExchangeResult {
    /// When it was sent \[ns\].
    sent: u64,
    /// When it passed the reference clock, by that clock \[ns\], and its working counter; none where it was lost.
    answer: Option<(u64, u16)>,
}

/// Exchanges frames as a run does; returns their statistics, none where memory is short.
pub(crate) fn listen<L: Link>(
    wire: &mut Wire<L>,
    group: &Devices<SafeOp>,
    table: &Table,
) -> Option<Listening> {
    let bus = &table.bus;
    let mut pace = exchange_until_sync0(wire, group, table);
    let Times { mut margin, mut round_trip } = Times::new()?;
    let Times { margin: mut late_by, round_trip: mut periods } = Times::new()?;
    let mut phases = margin.clone();
    let window = || LossWindow::new(bus.lost_max, bus.window);
    let (mut lost, mut late) = (window(), window());
    let mut statistics = Listening {
        cycles: CYCLES,
        working_counter: table.devices.iter().map(|row| row.working_counter()).sum(),
        ..Listening::default()
    };
    let mut before: Option<u64> = None;
    for _ in 0..CYCLES {
        let (mut is_lost, mut is_late, mut begin) = (false, false, None);
        for number in 0..bus.exchanges {
            let due = if number == 0 { pace.next_exchange() } else { pace.in_cycle(bus.send) };
            wire.link.wait(due);
            let ExchangeResult { sent, answer } = exchange(wire, group, &mut pace, table);
            statistics.exchanges += 1;
            if number == 0 {
                late_by.saturating_record(sent.saturating_sub(due).max(1));
                if let Some(before) = before.replace(sent) {
                    periods.saturating_record(sent.saturating_sub(before).max(1));
                }
            }
            let Some((passed, counter)) = answer else {
                (statistics.lost, is_lost) = (statistics.lost + 1, true);
                continue;
            };
            round_trip.saturating_record(now().saturating_sub(sent).max(1));
            if counter != statistics.working_counter {
                statistics.wrong_working_counter += 1;
                statistics.last_wrong_working_counter = counter;
            }
            let begin = *begin.get_or_insert(passed - passed % bus.period);
            if number == 0 {
                phases.saturating_record(passed.saturating_sub(begin).max(1));
            }
            // the last exchange of a cycle has its outputs
            if number + 1 == bus.exchanges {
                match (begin + bus.period).checked_sub(passed) {
                    Some(left) => margin.saturating_record(left.max(1)),
                    None => {
                        (statistics.late_outputs, is_late) = (statistics.late_outputs + 1, true)
                    }
                }
            }
        }
        statistics.has_too_many_lost |= lost.record(is_lost);
        statistics.has_too_many_late |= late.record(is_late);
    }
    Some(Listening {
        margin: Percentiles::of(&margin),
        phase: Percentiles::of(&phases),
        round_trip: Percentiles::of(&round_trip),
        late_by: Percentiles::of(&late_by),
        period: Percentiles::of(&periods),
        ..statistics
    })
}

/// Exchanges process data once, until the deadline of the answer, and updates the estimate of SYNC0.
fn exchange<L: Link>(
    wire: &mut Wire<L>,
    group: &Devices<SafeOp>,
    pace: &mut Pace,
    table: &Table,
) -> ExchangeResult {
    let main = wire.main;
    let sent = now();
    let end = pace.answer_deadline(sent, &table.bus, MARGIN);
    let answer = wire.run_until(group.tx_rx_dc(main), end).and_then(Result::ok);
    pace.update(sent, answer.as_ref().map(|answer| answer.extra.dc_system_time));
    let answer = answer.map(|answer| (answer.extra.dc_system_time, answer.working_counter));
    ExchangeResult { sent, answer }
}
