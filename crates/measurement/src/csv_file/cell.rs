//! Content of a table's cell.

/// Content of a table's cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cell {
    /// A finite number.
    Number(f64),
    /// No value.
    Missing,
    /// A date, a time of a day, both, or a duration.
    Stamp(Stamp),
    /// Any other text.
    Text,
}

/// A date, a time of a day, both, or a duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stamp {
    /// Days since 1970, where there is a date.
    pub(super) day: Option<i64>,
    /// Seconds of the day or of the duration, if given.
    pub(super) seconds: Option<f64>,
}

/// Number format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Decimal {
    /// Whether the decimal mark is a comma; otherwise it is a point.
    pub(super) is_comma: bool,
    /// Meaning of the other mark between groups of three digits.
    pub(super) other: OtherMark,
}

/// Meaning of a point in a table with decimal commas, and of a comma in one with decimal points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OtherMark {
    /// Thousands separator: other numbers show which mark is the decimal one.
    Thousands,
    /// A second decimal mark: other numbers have fewer or more than three digits after it.
    Decimal,
    /// Undetermined: `2.254` may be two or two thousand.
    Unknown,
}

impl Decimal {
    /// A format with this decimal mark; the other mark is undetermined.
    pub(super) const fn mark(is_comma: bool) -> Self {
        Self { is_comma, other: OtherMark::Unknown }
    }

    /// The same format with the other mark determined from the texts of some cells.
    pub(super) fn judged<'a>(self, texts: impl Iterator<Item = &'a str>) -> Self {
        let (decimal, other) = if self.is_comma { (',', '.') } else { ('.', ',') };
        let (mut is_shown, mut is_contradicted) = (false, false);
        for text in texts {
            let alone = |mark: char, without: char| {
                text.contains(mark) && !text.contains(without) && !is_grouped(text, mark)
            };
            let is_number = |mark: char| text.replace(mark, ".").parse::<f64>().is_ok();
            is_shown |= alone(decimal, other) && is_number(decimal);
            is_contradicted |= alone(other, decimal) && is_number(other);
        }
        let other = match (is_contradicted, is_shown) {
            (true, _) => OtherMark::Decimal,
            (_, true) => OtherMark::Thousands,
            _ => OtherMark::Unknown,
        };
        Self { other, ..self }
    }
}

/// Whether a text is a whole number with a mark between groups of three digits: `2.254`, `-12.345.678`, and not
/// `0.254`.
fn is_grouped(text: &str, mark: char) -> bool {
    let mut groups = text.trim_start_matches(['-', '+', '−']).split(mark);
    let is_digits = |g: &str| !g.is_empty() && g.bytes().all(|b| b.is_ascii_digit());
    let is_first = |g: &str| is_digits(g) && g.len() <= 3 && !g.starts_with('0');
    let mut count = 0;
    groups.next().is_some_and(is_first)
        && groups.all(|g| {
            count += 1;
            is_digits(g) && g.len() == 3
        })
        && count > 0
}

/// Words for a missing value.
const MISSING: [&str; 17] = [
    "nan",
    "na",
    "n/a",
    "null",
    "none",
    "nil",
    "inf",
    "-inf",
    "+inf",
    "infinity",
    "-infinity",
    "invalid",
    "missing",
    "bad",
    "ovf",
    "overflow",
    "-nan",
];
/// Words for the state "on" of a switch.
const ON: [&str; 6] = ["true", "on", "wahr", "ein", "yes", "ja"];
const OFF: [&str; 6] = ["false", "off", "falsch", "aus", "no", "nein"];
/// Longest text that is parsed as a number or time; longer cells are text.
const LONGEST: usize = 64;

impl Cell {
    /// Parses a cell.
    pub(super) fn read(text: &str, decimal: Decimal) -> Self {
        let text = text.trim().trim_matches('"').trim();
        if text.is_empty() {
            return Self::Missing;
        }
        let first = text.as_bytes()[0];
        // fast path for plain numbers
        if !decimal.is_comma
            && (first.is_ascii_digit() || first == b'-')
            && let Ok(value) = text.parse::<f64>()
        {
            return Self::finite(value);
        }
        if text.len() > LONGEST {
            return Self::Text;
        }
        if let Some(value) = number(text, decimal) {
            return Self::finite(value);
        }
        let small = text.to_lowercase();
        // `#N/A`, `#WERT!`; `1.#QNAN`, `-1.#IND`; `---`
        let is_error = (small.starts_with('#') && small.len() > 2 && !small[1..].contains(' '))
            || small.contains(".#");
        let is_dash = small.chars().all(|c| "-–—.*?_".contains(c));
        if is_error || is_dash || MISSING.contains(&small.as_str()) || small.starts_with("nan(") {
            return Self::Missing;
        }
        if ON.contains(&small.as_str()) {
            return Self::Number(1.0);
        }
        if OFF.contains(&small.as_str()) {
            return Self::Number(0.0);
        }
        Stamp::read(text).map_or(Self::Text, Self::Stamp)
    }

    fn finite(value: f64) -> Self {
        if value.is_finite() { Self::Number(value) } else { Self::Missing }
    }

    /// The number; NaN for other content.
    pub(super) fn number(self) -> f64 {
        match self {
            Self::Number(value) => value,
            _ => f64::NAN,
        }
    }

    /// Whether it is a number or a time.
    pub(super) fn is_data(self) -> bool {
        matches!(self, Self::Number(_) | Self::Stamp(_))
    }
}

/// Parses a number with thousands separators, Fortran's exponent `D` or a Unicode minus.
fn number(text: &str, decimal: Decimal) -> Option<f64> {
    let has_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit() || c == '.' || c == ',');
    if !text.contains(|c: char| c.is_ascii_digit())
        || (!has_digit(text.chars().next_back()) || text.ends_with(','))
    {
        return None;
    }
    let mut plain = String::with_capacity(text.len());
    let decimal_comma = decimal.is_comma;
    let (mark, other) = if decimal_comma { (',', '.') } else { ('.', ',') };
    let is_alone = text.contains(other) && !text.contains(mark);
    let thousands = match (text.contains(mark), decimal.other) {
        (true, _) => Some(other),
        (_, OtherMark::Thousands) if is_alone && is_grouped(text, other) => Some(other),
        (_, OtherMark::Unknown) if is_alone && decimal_comma && is_grouped(text, other) => {
            return None;
        }
        _ => None,
    };
    for c in text.chars() {
        match c {
            '−' => plain.push('-'),
            'D' | 'd' => plain.push('e'),
            c if Some(c) == thousands => {}
            ',' if decimal_comma => plain.push('.'),
            '\u{a0}' | '\u{202f}' | '\'' => {}
            c => plain.push(c),
        }
    }
    // a thousands separator is followed by three digits
    let parts: Vec<&str> = match thousands {
        Some(sign) => text.split(sign).skip(1).collect(),
        None => Vec::new(),
    };
    let is_apart = |part: &&str| part.chars().take_while(char::is_ascii_digit).count() == 3;
    if !parts.iter().all(is_apart) {
        return None;
    }
    plain.parse().ok()
}

impl Stamp {
    /// A date (`2024-01-31`, `31.01.2024`, `1/31/2024`), a time of a day or a duration (`10:00:00,123`, `00:01:02.5
    /// PM`), or both separated by a blank or a `T`. The offset of a time zone (`Z`, `+01:00`) is subtracted.
    fn read(text: &str) -> Option<Self> {
        let text = text.trim_end_matches(['Z', 'z']).trim();
        let (text, noon) = match text.to_ascii_uppercase() {
            upper if upper.ends_with("PM") => (&text[..text.len() - 2], Some(12.0)),
            upper if upper.ends_with("AM") => (&text[..text.len() - 2], Some(0.0)),
            _ => (text, None),
        };
        let parts: Vec<&str> = text.split(['T', ' ']).filter(|p| !p.is_empty()).collect();
        let (date, clock) = match parts.as_slice() {
            [one] if one.contains(':') => (None, Some(*one)),
            [one] => (Some(*one), None),
            // `0 days 00:00:01.5`, pandas' format of a duration
            [days, word, clock] if word.starts_with("day") => {
                let days: f64 = days.parse().ok()?;
                let seconds = clock_seconds(clock)? + days * 86_400.0;
                return Some(Self { day: None, seconds: Some(seconds) });
            }
            [date, clock, ..] if parts.len() <= 3 => (Some(*date), Some(*clock)),
            _ => return None,
        };
        let day = match date {
            Some(text) => Some(day(text)?),
            None => None,
        };
        let seconds = match clock {
            Some(text) => Some(clock_seconds(text)? - day.map_or(0.0, |_| zone(text))),
            None => None,
        };
        let seconds = match (seconds, noon) {
            (Some(s), Some(noon)) => Some(s % (12.0 * 3600.0) + noon * 3600.0),
            (seconds, _) => seconds,
        };
        Some(Self { day, seconds })
    }
}

/// Seconds of `10:00:00.123`, `10:00`, `10:00:00,123+01:00`, `10:00:00:123`.
fn clock_seconds(text: &str) -> Option<f64> {
    let (sign, text) = match text.strip_prefix('-') {
        Some(rest) => (-1.0, rest),
        None => (1.0, text),
    };
    // the zone
    let text = text.split(['+', '-']).next()?;
    let fields: Vec<&str> = text.split(':').collect();
    let whole = |text: &&str| text.parse::<u32>().ok().filter(|_| !text.is_empty());
    let (hours, minutes, seconds) = match fields.as_slice() {
        [h, m] => (whole(h)?, whole(m)?, 0.0),
        [h, m, s] => (whole(h)?, whole(m)?, decimal(s)?),
        // milliseconds or microseconds after a third colon
        [h, m, s, fraction] => {
            let small = f64::from(whole(fraction)?) / 10_f64.powi(fraction.len() as i32);
            (whole(h)?, whole(m)?, f64::from(whole(s)?) + small)
        }
        _ => return None,
    };
    (minutes < 60 && seconds < 61.0)
        .then(|| sign * (f64::from(hours) * 3600.0 + f64::from(minutes) * 60.0 + seconds))
}

/// Offset from UTC \[s\] of the zone in `10:00:00+01:00`, `10:00:00-0330` or `10:00:00+01`; zero without a zone.
fn zone(text: &str) -> f64 {
    let Some(at) = text.rfind(['+', '-']).filter(|at| *at > 0) else { return 0.0 };
    let digits: String = text[at + 1..].chars().filter(char::is_ascii_digit).collect();
    let (hours, minutes) = digits.split_at(digits.len().min(2));
    let of = |text: &str| text.parse::<u32>().map_or(0.0, f64::from);
    let ahead = of(hours) * 3600.0 + of(minutes) * 60.0;
    if text[at..].starts_with('-') { -ahead } else { ahead }
}

fn decimal(text: &str) -> Option<f64> {
    let is_plain = text.chars().all(|c| c.is_ascii_digit() || c == '.' || c == ',');
    let value = text.replace(',', ".").parse::<f64>().ok();
    value.filter(|_| is_plain && text.starts_with(|c: char| c.is_ascii_digit()))
}

/// Days since 1970 of a date.
fn day(text: &str) -> Option<i64> {
    let sign = text.chars().find(|c| !c.is_ascii_digit())?;
    let fields: Vec<&str> = text.split(sign).filter(|field| !field.is_empty()).collect();
    let [a, b, c] = fields.as_slice() else { return None };
    // `1.2.3` is a version number
    if a.len() < 2 && c.len() < 2 {
        return None;
    }
    let number = |text: &str| text.parse::<i64>().ok().filter(|n| *n >= 0);
    let (a, b, c) = (number(a)?, number(b)?, number(c)?);
    let (year, month, day) = match sign {
        '-' | '/' | '.' if a > 31 => (a, b, c),
        '.' | '-' => (c, b, a),
        '/' if a > 12 => (c, b, a),
        '/' => (c, a, b),
        _ => return None,
    };
    let year = if year < 100 { year + 2000 } else { year };
    let is_date =
        (1900..3000).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    is_date.then(|| days_since_1970(year, month, day))
}

/// Days from 1 January 1970 to a date of the Gregorian calendar. Years begin in March here, so that the leap day is the
/// last day.
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let months_since_march = (month + 9) % 12;
    let day_of_year = (153 * months_since_march + 2) / 5 + day - 1;
    365 * year + year / 4 - year / 100 + year / 400 + day_of_year - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_in_every_usual_notation() {
        for (text, comma, value) in [
            ("1.5", false, 1.5),
            ("-1,5", true, -1.5),
            ("\"2,5\"", true, 2.5),
            ("1.234,5", true, 1234.5),
            ("1,013.25", false, 1013.25),
            ("1.5D-3", false, 1.5e-3),
            ("−4.5", false, -4.5),
            ("+3", false, 3.0),
            ("1E+05", false, 1e5),
            (".5", false, 0.5),
            ("TRUE", false, 1.0),
            ("aus", true, 0.0),
        ] {
            assert_eq!(Cell::read(text, Decimal::mark(comma)), Cell::Number(value), "{text}");
        }
        for text in [
            "", " ", "NaN", "#N/A", "#NV", "#WERT!", "---", "-", "1.#QNAN", "-1.#IND", "1.#INF",
            "inf", "n/a", "?", "nan(ind)", "1e999",
        ] {
            assert_eq!(Cell::read(text, Decimal::mark(false)), Cell::Missing, "{text}");
        }
        for text in [
            "IDLE",
            "1,5",
            "5 bar",
            "1.2.3",
            "e",
            "d",
            "0,",
            "1,50.5",
            "# note",
            "x".repeat(99).as_str(),
        ] {
            assert_eq!(Cell::read(text, Decimal::mark(false)), Cell::Text, "{text}");
        }
    }

    #[test]
    fn thousands_separators_are_recognised_by_the_other_numbers() {
        let judged =
            |is_comma: bool, texts: &[&str]| Decimal::mark(is_comma).judged(texts.iter().copied());
        let german = judged(true, &["0,010", "103", "2.254"]);
        assert_eq!(Cell::read("2.254", german), Cell::Number(2254.0));
        assert_eq!(Cell::read("-1.002.254", german), Cell::Number(-1_002_254.0));
        assert_eq!(Cell::read("0.254", german), Cell::Number(0.254));
        let english = judged(false, &["0.01", "2,254"]);
        assert_eq!(Cell::read("2,254", english), Cell::Number(2254.0));
        // a point that is used as a decimal mark too
        let mixed = judged(true, &["0,010", "12.5", "2.254"]);
        assert_eq!(Cell::read("2.254", mixed), Cell::Number(2.254));
        // undetermined
        assert_eq!(Cell::read("2.254", judged(true, &["3,170", "2.254"])), Cell::Text);
        assert_eq!(Cell::read("2,254", judged(false, &["3", "2,254"])), Cell::Text);
    }

    #[test]
    fn time_stamps_in_every_notation_give_the_same_time() {
        let seconds = |text: &str| match Cell::read(text, Decimal::mark(false)) {
            Cell::Stamp(Stamp { day, seconds }) => {
                (day.unwrap_or(0) * 86_400) as f64 + seconds.unwrap_or(0.0)
            }
            other => panic!("{text}: {other:?}"),
        };
        // 31 January 2024, 10:00:00 is 1706695200 s after 1970
        for text in [
            "2024-01-31T10:00:00.25Z",
            "2024-01-31 11:00:00.250+01:00",
            "2024-01-31T06:30:00,25-0330",
            "2024-02-01T00:00:00.25+14",
            "31.01.2024 10:00:00,25",
            "1/31/2024 10:00:00.25 AM",
            "2024/01/31 10:00:00:250",
            "31.01.24 10:00:00,25",
        ] {
            assert!((seconds(text) - 1_706_695_200.25).abs() < 1e-6, "{text}: {}", seconds(text));
        }
        assert_eq!(seconds("10:00:01.5"), 36_001.5);
        assert_eq!(seconds("10:00:01.5 PM"), 79_201.5);
        assert_eq!(seconds("0 days 00:00:01.5"), 1.5);
        assert_eq!(seconds("2000-03-01") - seconds("2000-02-28"), 2.0 * 86_400.0);
        assert_eq!(seconds("2100-03-01") - seconds("2100-02-28"), 86_400.0);
        assert_eq!(seconds("1970-01-01"), 0.0);
        for text in [
            "a:b",
            "10:99:00",
            "2024-13-01",
            "1.2",
            "::",
            ":",
            "T",
            "Z",
            "AM",
            "é:1",
            "1:2:3:4:5",
            "99:éé",
        ] {
            assert!(!matches!(Cell::read(text, Decimal::mark(false)), Cell::Stamp(_)), "{text}");
        }
    }
}
