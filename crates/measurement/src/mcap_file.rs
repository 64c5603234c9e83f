//! MCAP logs whose messages are JSON objects of numbers: those of `hydroboom run`, and others'.

use crate::channel::{Channel, Measurement};
use crate::error::MeasurementError;
use crate::thinning::{Columns, MOST};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Messages of one topic.
struct Topic {
    names: Vec<String>,
    data: Columns,
    last: f64,
}

pub(crate) fn read(path: &Path) -> Result<Measurement, MeasurementError> {
    let file = path.display().to_string();
    let failed = |error| MeasurementError::File { file: file.clone(), error };
    let format = |reason: String| MeasurementError::Format { file: file.clone(), reason };
    let source = File::open(path).map_err(failed)?;
    // SAFETY: the map is only read, as bytes, for which any value is valid. A file that another process cuts
    // short meanwhile is not guarded against: a log is complete when it is looked at.
    #[expect(unsafe_code, reason = "a large file is not copied to be read")]
    let bytes = unsafe { memmap2::Mmap::map(&source) }.map_err(failed)?;
    let options = [mcap::read::Options::IgnoreEndMagic];
    let messages = mcap::MessageStream::new_with_options(&bytes, options.into_iter().collect())
        .map_err(|e| format(e.to_string()))?;
    let mut topics: BTreeMap<String, Topic> = BTreeMap::new();
    let (mut foreign, mut cut) = (0_u64, false);
    for message in messages {
        // the last chunk of a log that was cut off
        let Ok(message) = message else {
            cut = true;
            break;
        };
        if message.channel.message_encoding != "json" {
            foreign += 1;
            continue;
        }
        let value: Value = match serde_json::from_slice(&message.data) {
            Ok(value) => value,
            Err(e) => return Err(format(format!("a message on {}: {e}", message.channel.topic))),
        };
        let Some(object) = value.as_object() else { continue };
        let time = message.log_time as f64 * 1e-9;
        let topic = topics.entry(message.channel.topic.clone()).or_insert_with(|| {
            let is_number = |v: &Value| v.is_number() || v.is_boolean();
            let names: Vec<String> =
                object.iter().filter(|(_, v)| is_number(v)).map(|(k, _)| k.clone()).collect();
            Topic { data: Columns::new(names.len() + 1, MOST / 4), names, last: f64::NEG_INFINITY }
        });
        if time < topic.last {
            continue;
        }
        topic.last = time;
        let cell = |name: &String| match object.get(name) {
            Some(Value::Bool(on)) => f64::from(u8::from(*on)),
            Some(value) => value.as_f64().unwrap_or(f64::NAN),
            None => f64::NAN,
        };
        let row: Vec<f64> = std::iter::once(time).chain(topic.names.iter().map(cell)).collect();
        topic.data.push(&row);
    }
    let mut remarks = Vec::new();
    if cut {
        remarks.push("it was cut off: it is read up to there".into());
    }
    if foreign > 0 {
        remarks.push(format!("{foreign} messages are not JSON and are left out"));
    }
    let mut channels = Vec::new();
    for topic in topics.into_values() {
        let mut data = topic.data.finish().into_iter();
        let time: Arc<[f64]> = data.next().unwrap_or_default().into();
        if time.len() < 2 {
            continue;
        }
        for (heading, values) in topic.names.into_iter().zip(data) {
            channels.push(Channel::new(&heading, Arc::clone(&time), values));
        }
    }
    if channels.is_empty() {
        let found = "no topic has two messages of numbers (JSON objects)".into();
        return Err(MeasurementError::Empty { file, found });
    }
    Ok(Measurement { name: file, channels, remarks })
}
