//! What differs between two descriptions.

use crate::Description;
use crate::parse::SEGMENT_LENGTHS;

/// One key with two values.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// `section.key`.
    pub key: String,
    /// Its value here.
    pub here: String,
    /// Its value there.
    pub there: String,
    /// Unit of both; empty for choices.
    pub unit: &'static str,
}

impl Difference {
    /// The override that makes this key here what it is there.
    pub fn assignment(&self) -> String {
        format!("{}={}", self.key, self.there)
    }
}

impl Description {
    /// Every key whose value differs in `other`, names left out.
    pub fn differences(&self, other: &Self) -> Vec<Difference> {
        let text = |description: &Self| {
            let shares: Vec<String> =
                description.segment_shares.iter().map(f64::to_string).collect();
            let choices = description.choices.list().map(|(path, name)| (path, name.to_string()));
            choices.into_iter().chain([(SEGMENT_LENGTHS, shares.join(","))])
        };
        let numbers =
            self.entries().zip(other.entries()).map(|((key, here, _), (_, there, _))| Difference {
                key: key.path(),
                here: here.to_string(),
                there: there.to_string(),
                unit: key.unit,
            });
        let texts = text(self).zip(text(other)).map(|((key, here), (_, there))| Difference {
            key: key.into(),
            here,
            there,
            unit: "",
        });
        numbers.chain(texts).filter(|difference| difference.here != difference.there).collect()
    }
}
