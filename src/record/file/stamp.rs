//! [`Stamp`]: a date or time of day in a cell, as instruments and spreadsheets write it.

use jiff::civil::{Date, DateTime, Time};
use jiff::{Timestamp, ZonedDateTime};

/// What a cell says about time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stamp {
    /// A date with a zone.
    Instant(Timestamp),
    /// A date without one. Numbers such as 03/04/2025 are read day first and month first; `None` where that gives no date.
    Local([Option<DateTime>; 2]),
    /// A time without a date (s).
    Clock(f64),
}

/// Month names of English, as MATLAB and logs write them.
const MONTHS: [&str; 12] = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];

impl Stamp {
    /// Reads a cell; `None` where it is neither a date nor a time.
    pub(super) fn read(text: &str) -> Option<Stamp> {
        let text = text.trim();
        // Numbers are not dates, whatever the number of their digits.
        if !text.contains(['-', '/', '.', ':']) || text.parse::<f64>().is_ok() {
            return None;
        }
        let universal =
            [" UTC", " GMT", " Z"].iter().find_map(|zone| text.strip_suffix(zone)).map(|text| format!("{text}Z"));
        let iso = universal.as_deref().unwrap_or(text);
        // An offset may stand apart.
        let iso = match iso.rsplit_once(' ') {
            Some((date, offset)) if offset.starts_with(['+', '-']) => format!("{date}{offset}"),
            _ => iso.to_owned(),
        };
        if let Ok(zoned) = iso.parse::<ZonedDateTime>() {
            return Some(Stamp::Instant(zoned.timestamp()));
        }
        if let Ok(instant) = iso.parse::<Timestamp>() {
            return Some(Stamp::Instant(instant));
        }
        if let Ok(local) = iso.parse::<DateTime>() {
            return Some(Stamp::Local([Some(local); 2]));
        }
        let (date, clock) = text.split_once([' ', 'T']).unwrap_or((text, ""));
        let Some(dates) = dates(date.trim_end_matches(',')) else { return seconds(text).map(Stamp::Clock) };
        let time = if clock.is_empty() { Time::midnight() } else { time(clock)? };
        let local = dates.map(|date| date.map(|date| date.to_datetime(time)));
        (local != [None; 2]).then_some(Stamp::Local(local))
    }
}

/// The dates that three numbers, or two and the name of a month, can be: day first and month first.
fn dates(text: &str) -> Option<[Option<Date>; 2]> {
    let separator = text.chars().find(|letter| ['/', '.', '-'].contains(letter))?;
    let mut parts = text.split(separator);
    let [a, b, c] = [parts.next()?, parts.next()?, parts.next()?];
    if parts.next().is_some() {
        return None;
    }
    let number = |text: &str| text.parse::<i8>().ok().filter(|number| *number > 0 && text.len() <= 2);
    let year = |text: &str| match text.len() {
        4 => text.parse::<i16>().ok(),
        // As POSIX has it: 69 to 99 are of the last century. Between other signs than points a year may stand first.
        2 if separator == '.' => text.parse().ok().map(|year: i16| if year < 69 { 2000 + year } else { 1900 + year }),
        _ => None,
    };
    let date = |year, month, day| Date::new(year, month, day).ok();
    if a.len() == 4 {
        return Some([date(year(a)?, number(b)?, number(c)?); 2]);
    }
    if let Some(month) = MONTHS.iter().position(|month| b.eq_ignore_ascii_case(month)) {
        return Some([date(year(c)?, month as i8 + 1, number(a)?); 2]);
    }
    let (a, b, year) = (number(a)?, number(b)?, year(c)?);
    // Between points, the day stands first everywhere.
    Some([date(year, b, a), if separator == '.' { None } else { date(year, a, b) }])
}

/// A time of day: `14:05`, `2:05:00.25 PM`.
fn time(text: &str) -> Option<Time> {
    let lower = text.trim().to_ascii_lowercase();
    let (digits, half) = match (lower.strip_suffix("am"), lower.strip_suffix("pm")) {
        (Some(digits), _) => (digits.trim_end(), Some(0)),
        (_, Some(digits)) => (digits.trim_end(), Some(12)),
        _ => (lower.as_str(), None),
    };
    let mut parts = digits.split(':');
    let (hour, minute) = (parts.next()?.parse::<i8>().ok()?, parts.next()?.parse::<i8>().ok()?);
    let (second, fraction) = match parts.next().unwrap_or("0").split_once(['.', ',']) {
        Some((second, fraction)) => (second.to_owned(), fraction.to_owned()),
        None => (digits.split(':').nth(2).unwrap_or("0").to_owned(), String::new()),
    };
    if parts.next().is_some() || fraction.len() > 9 || !fraction.bytes().all(|digit| digit.is_ascii_digit()) {
        return None;
    }
    let hour = match half {
        Some(_) if !(1..=12).contains(&hour) => return None,
        Some(half) => hour % 12 + half,
        None => hour,
    };
    Time::new(hour, minute, second.parse().ok()?, format!("{fraction:0<9}").parse().ok()?).ok()
}

/// Hours, minutes and seconds without a date, or minutes and seconds where the seconds have decimals (s).
fn seconds(text: &str) -> Option<f64> {
    let parts: Vec<&str> = text.split(':').collect();
    let number = |text: &str, end: f64| {
        let number = text.replace(',', ".").parse::<f64>().ok()?;
        (number >= 0.0 && number < end && text.as_bytes()[0].is_ascii_digit()).then_some(number)
    };
    match parts[..] {
        [hours, minutes, seconds] if hours.bytes().all(|digit| digit.is_ascii_digit()) => {
            Some(number(hours, f64::INFINITY)? * 3600.0 + number(minutes, 60.0)? * 60.0 + number(seconds, 60.0)?)
        }
        [minutes, seconds] if seconds.contains(['.', ',']) => {
            Some(number(minutes, f64::INFINITY)? * 60.0 + number(seconds, 60.0)?)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jiff::civil::date;

    #[test]
    fn dates_of_many_programs_are_read() {
        let noon = date(2025, 3, 20).at(12, 0, 0, 0);
        let universal = Some(Stamp::Instant("2025-03-20T12:00:00Z".parse().unwrap()));
        for text in [
            "2025-03-20T12:00:00Z",
            "2025-03-20 12:00:00+00:00",
            "2025-03-20 13:00:00 +01:00",
            "2025-03-20 12:00:00 UTC",
            "2025-03-20T07:00-0500",
            "2025-03-20T13:00:00+01:00[Europe/Berlin]",
        ] {
            assert_eq!(Stamp::read(text), universal, "{text}");
        }
        for text in ["2025-03-20 12:00:00", "2025-03-20T12:00", "2025/03/20 12:00:00.000", "20-Mar-2025 12:00:00"] {
            assert_eq!(Stamp::read(text), Some(Stamp::Local([Some(noon); 2])), "{text}");
        }
        for text in ["20.03.2025 12:00", "20/3/2025 12:00 PM", "20.03.25 12:00:00,0", "20.03.2025 12:00:00"] {
            assert_eq!(Stamp::read(text), Some(Stamp::Local([Some(noon), None])), "{text}");
        }
        assert_eq!(Stamp::read("3/20/2025 12:00:00 pm"), Some(Stamp::Local([None, Some(noon)])));
        let [day, month] = [date(2025, 4, 3), date(2025, 3, 4)].map(|date| Some(date.at(0, 5, 0, 250_000_000)));
        assert_eq!(Stamp::read("03/04/2025 12:05:00.25 AM"), Some(Stamp::Local([day, month])));
    }

    #[test]
    fn times_without_a_date_are_seconds() {
        for (text, seconds) in
            [("12:30:00", 45_000.0), ("100:00:00,5", 360_000.5), ("12:30.5", 750.5), ("0:00:01", 1.0)]
        {
            assert_eq!(Stamp::read(text), Some(Stamp::Clock(seconds)), "{text}");
        }
    }

    /// Hours and minutes, or minutes and seconds; numbers; days that do not exist; text.
    #[test]
    fn what_is_no_date_is_none() {
        for text in [
            "12:30",
            "20250320",
            "25-03-20 12:00",
            "03/20/25",
            "1.5",
            "-3",
            "1e-3",
            "31.02.2025",
            "13/13/2025",
            "20.03.2025 25:00",
            "1/2/3/4",
            "",
            "a.b.c",
            "12:61:00",
            "12:-1:00",
            "20.03.2025 13:00 PM",
            "V",
            "rad/s",
            "m/s",
            "1/min",
            "20.03",
            "192.168.0.1",
        ] {
            assert_eq!(Stamp::read(text), None, "{text}");
        }
    }
}
