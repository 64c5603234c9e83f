//! The log of a bus: a message for each of its cycles, beside those of the control periods.

use hydroboom_fieldbus::cycle_record::CycleRecord;
use hydroboom_fieldbus::fault::Fault;
use hydroboom_fieldbus::table::Table;
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::log::{LogError, LogWriter, Topic};
use rtrb::Consumer;
use serde_json::{Map, Value, json};

/// Names, with units, and JSON types of the fields.
const FIELDS: [(&str, &str); 14] = [
    ("time_s", "number"),
    ("reading_number", "number"),
    ("device_time_s", "number"),
    ("first_phase_us", "number"),
    ("first_working_counter", "number"),
    ("second_phase_us", "number"),
    ("second_working_counter", "number"),
    ("state", "object"),
    ("statusword", "object"),
    ("error_code", "object"),
    ("outputs", "object"),
    ("inputs", "object"),
    ("al_status_code", "number"),
    ("fault", "string"),
];

/// Log of a bus: its cycles as messages of an MCAP log, until the one of each control period.
pub struct BusLog {
    table: Table,
    /// Records of the cycles, from the bus's thread.
    records: Consumer<CycleRecord>,
    /// Topic of the messages; none before the first one.
    topic: Option<Topic>,
    /// Time of the monotonic clock at the log's time zero \[ns\]; none before the first measurement that control read.
    zero: Option<u64>,
}

impl BusLog {
    /// Log of a bus with a table, whose cycles come by a queue.
    pub fn new(table: Table, records: Consumer<CycleRecord>) -> Self {
        Self { table, records, topic: None, zero: None }
    }

    /// Adds the cycles until the one whose measurement a control period read.
    ///
    /// # Errors
    ///
    /// [`LogError`] if a message cannot be written.
    pub fn add_until(&mut self, record: &Record, log: &mut LogWriter) -> Result<(), LogError> {
        let newest = record.measurement.number;
        while self.records.peek().is_ok_and(|cycle| cycle.measurement <= newest) {
            let Ok(cycle) = self.records.pop() else { break };
            if self.zero.is_none() && cycle.measurement == newest {
                // control begins in the phase of SYNC0 that the table gives it
                let beginning = cycle.sync0[0] + self.table.bus.control();
                self.zero = Some(beginning.saturating_sub((record.time * 1e9) as u64));
            }
            // those before control began have no time of the log
            let Some(zero) = self.zero else { continue };
            let time = 1e-9 * cycle.sync0[0].saturating_sub(zero) as f64;
            let topic = match &mut self.topic {
                Some(topic) => topic,
                topic => topic.insert(log.add_bus_topic(&FIELDS)?),
            };
            log.add_message(topic, time, message(&self.table, &cycle, time))?;
        }
        Ok(())
    }
}

/// A cycle as a message; `time` is that of its SYNC0 in the log \[s\]. Exchanges without a time or working counter are
/// left out.
fn message(table: &Table, cycle: &CycleRecord, time: f64) -> Map<String, Value> {
    let mut message = Map::new();
    let mut put = |name: &str, value: Value| message.insert(name.into(), value);
    put("time_s", json!(time));
    put("reading_number", json!(cycle.measurement));
    put("device_time_s", json!(1e-9 * cycle.sync0[1] as f64));
    let names = [
        ["first_phase_us", "first_working_counter"],
        ["second_phase_us", "second_working_counter"],
    ];
    for ([phase, counter], exchange) in names.iter().zip(&cycle.exchanges) {
        // lost frames have neither
        if let (Some(time), Some(count)) = (exchange.phase, exchange.working_counter) {
            put(phase, json!(1e-3 * f64::from(time)));
            put(counter, json!(count));
        }
    }
    let states = table.devices.iter().zip(cycle.states);
    put("state", states.map(|(row, state)| (row.name.clone(), json!(state))).collect());
    let drives = || {
        let name = |device: usize| table.devices.get(device).map(|row| row.name.clone());
        table.drives.iter().filter_map(move |row| name(row.device)).zip(cycle.drives)
    };
    put("statusword", drives().map(|(name, [word, _])| (name, json!(word))).collect());
    put("error_code", drives().map(|(name, [_, code])| (name, json!(code))).collect());
    let images = || cycle.image.devices(table);
    put(
        "outputs",
        images().map(|(name, bytes, _)| (name.to_string(), json!(hex(bytes)))).collect(),
    );
    put("inputs", images().map(|(name, _, bytes)| (name.to_string(), json!(hex(bytes)))).collect());
    if let Some(Fault::StateDropped { code, .. }) = cycle.fault {
        put("al_status_code", json!(code));
    }
    put("fault", json!(cycle.fault.map_or("", Fault::name)));
    message
}

/// Bytes in hexadecimal digits, the first one first.
fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
