//! [`Dates`]: a column of dates as seconds from its first; where the day stands, and where clocks are changed.

use super::stamp::Stamp;
use super::{DateOrder, Fault};
use crate::record::Time;
use jiff::Timestamp;
use jiff::civil::{DateTime, Weekday};
use jiff::tz::{AmbiguousOffset, TimeZone};

const HOUR: f64 = 3600.0;
const DAY: f64 = 86_400.0;

/// The stamps of a column so far.
pub(super) struct Dates {
    zone: Option<TimeZone>,
    said: Option<DateOrder>,
    /// Day first and month first; one alone until they first differ.
    ways: Vec<Way>,
}

/// The column read with the day first, or with the month first.
#[derive(Clone, Default)]
struct Way {
    month_first: bool,
    kind: Option<Kind>,
    first: i128,
    /// From the first stamp (s).
    seconds: Vec<f64>,
    /// Why it cannot be read so.
    fault: Option<Fault>,
}

/// Stamps of one column are of one kind.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Zoned,
    Local,
    Clock,
}

impl Dates {
    /// No stamp yet; of local times, in this zone.
    pub(super) fn new(said: Option<DateOrder>, zone: Option<TimeZone>) -> Dates {
        let month_first = said == Some(DateOrder::MonthFirst);
        Dates { zone, said, ways: vec![Way { month_first, ..Way::default() }] }
    }

    /// Takes the stamp of the next row; false where no order is left in which the column can be read.
    pub(super) fn push(&mut self, stamp: Stamp, text: &str, line: u64) -> bool {
        if let ([way], Stamp::Local([day, month])) = (&self.ways[..], stamp)
            && day != month
            && self.said.is_none()
        {
            self.ways.push(Way { month_first: true, ..way.clone() });
        }
        for way in &mut self.ways {
            if way.fault.is_none() {
                way.fault =
                    way.push(stamp, self.zone.as_ref()).err().map(|problem| Fault { line, text: text.into(), problem });
            }
        }
        self.ways.iter().any(|way| way.fault.is_none())
    }

    /// Whether the dates so far were read in the zone: those that have one of their own, and times of day, are not.
    pub(super) fn in_zone(&self) -> bool {
        self.zone.is_some() && self.ways.iter().any(|way| way.kind == Some(Kind::Local))
    }

    /// The times of all rows (s), and the order if it matters.
    ///
    /// # Errors
    /// The fault of the order that could be followed longest; dates that can be read both ways.
    pub(super) fn finish(self) -> Result<(Vec<f64>, Option<DateOrder>), Fault> {
        let differ = self.ways.len() > 1 || self.said.is_some();
        let longest = |ways: Vec<Way>| ways.into_iter().max_by_key(|way| way.seconds.len());
        let (good, bad): (Vec<Way>, Vec<Way>) = self.ways.into_iter().partition(|way| way.fault.is_none());
        let found = match &good[..] {
            [] => return Err(longest(bad).and_then(|way| way.fault).unwrap_or_default()),
            [day, month] if day.seconds != month.seconds => {
                let even = |way: &Way| matches!(Time::from_stamps(way.seconds.clone()), Time::Uniform { .. });
                match (even(day), even(month)) {
                    (true, false) => day,
                    (false, true) => month,
                    _ => {
                        let problem =
                            "its dates can be read with the day first and with the month first: say which by \
                                       DataFile::dates"
                                .to_owned();
                        return Err(Fault { problem, ..Fault::default() });
                    }
                }
            }
            [way, ..] => way,
        };
        let order = if found.month_first { DateOrder::MonthFirst } else { DateOrder::DayFirst };
        let matters = differ && !(good.len() == 2 && good[0].seconds == good[1].seconds);
        Ok((found.seconds.clone(), matters.then_some(order)))
    }
}

impl Way {
    fn push(&mut self, stamp: Stamp, zone: Option<&TimeZone>) -> Result<(), String> {
        let kind = match stamp {
            Stamp::Instant(_) => Kind::Zoned,
            Stamp::Local(_) => Kind::Local,
            Stamp::Clock(_) => Kind::Clock,
        };
        if *self.kind.get_or_insert(kind) != kind {
            return Err(
                "dates with a zone, dates without one, and times without a date do not mix in one column".into()
            );
        }
        match stamp {
            Stamp::Instant(instant) => self.instant(instant),
            Stamp::Local(ways) => {
                let local = ways[usize::from(self.month_first)]
                    .ok_or("there is no such date with the day or month before it")?;
                match zone {
                    Some(zone) => self.zoned(local, zone),
                    None => self.local(local),
                }
            }
            Stamp::Clock(clock) => self.clock(clock),
        }
    }

    fn since(&mut self, instant: Timestamp) -> f64 {
        let nanoseconds = instant.as_nanosecond();
        if self.seconds.is_empty() {
            self.first = nanoseconds;
        }
        (nanoseconds - self.first) as f64 / 1e9
    }

    fn last(&self) -> f64 {
        self.seconds.last().copied().unwrap_or(f64::NEG_INFINITY)
    }

    fn later(&mut self, seconds: f64, why: &str) -> Result<(), String> {
        if seconds < self.last() {
            let back = self.last() - seconds;
            return Err(format!("time runs backwards: it is {back} s before the row above{why}"));
        }
        self.seconds.push(seconds);
        Ok(())
    }

    fn instant(&mut self, instant: Timestamp) -> Result<(), String> {
        let seconds = self.since(instant);
        self.later(seconds, "; sort the record")
    }

    /// In a zone an hour occurs twice where clocks are set back: it is the second where time would run backwards, or, of samples an hour apart, stand
    /// still.
    fn zoned(&mut self, local: DateTime, zone: &TimeZone) -> Result<(), String> {
        let found = zone.to_ambiguous_timestamp(local);
        if let AmbiguousOffset::Gap { .. } = found.offset() {
            return Err("there is no such time in the zone: clocks were set forward over it".into());
        }
        let instants = [found.earlier(), found.later()].map(|instant| instant.map_err(|error| error.to_string()));
        let [earlier, later] = instants;
        let (earlier, later) = (earlier?, later?);
        let shift = (later.as_nanosecond() - earlier.as_nanosecond()) as f64 / 1e9;
        let seconds = self.since(earlier);
        if seconds > self.last() || seconds == self.last() && !self.repeats(shift) {
            return self.later(seconds, "");
        }
        self.instant(later)
    }

    /// Whether a row of the same time as the last one is that of clocks that were set back by so much: samples so far apart, each at an instant of its own.
    fn repeats(&self, shift: f64) -> bool {
        shift > 0.0 && self.step_before() == Some(shift) && self.seconds.is_sorted_by(|a, b| a < b)
    }

    /// Without a zone a clock that is set back or forward is not followed, and named.
    fn local(&mut self, local: DateTime) -> Result<(), String> {
        let instant = TimeZone::UTC.to_timestamp(local).map_err(|error| error.to_string())?;
        let seconds = self.since(instant);
        // Clocks are changed in the first hours of a Sunday.
        let changed = local.weekday() == Weekday::Sunday && (0..=4).contains(&local.hour());
        let remedy = "name the zone by DataFile::zone (\"Europe/Berlin\"; \"UTC\" if the clock is never changed)";
        let (step, before) = (seconds - self.last(), self.step_before());
        if changed
            && before.is_some_and(|before| before <= HOUR && (step - before - HOUR).abs() < 0.5 * before.min(HOUR))
        {
            return Err(format!(
                "the clock is an hour ahead of the rows above, as where daylight saving begins: {remedy}"
            ));
        }
        if changed && step == 0.0 && self.repeats(HOUR) {
            return Err(format!("it is the time of the row above, as where daylight saving ends: {remedy}"));
        }
        if changed && step < 0.0 && -step <= HOUR {
            return self.later(seconds, &format!(", as where daylight saving ends: {remedy}"));
        }
        self.later(seconds, "; sort the record")
    }

    /// The step before the last row (s).
    fn step_before(&self) -> Option<f64> {
        let n = self.seconds.len();
        (n > 1).then(|| self.seconds[n - 1] - self.seconds[n - 2])
    }

    /// A time of day goes on at midnight.
    fn clock(&mut self, clock: f64) -> Result<(), String> {
        if self.seconds.is_empty() {
            self.first = (clock * 1e9).round() as i128;
        }
        let mut seconds = ((clock * 1e9).round() as i128 - self.first) as f64 / 1e9;
        if clock < DAY {
            let days = ((self.last() - seconds) / DAY).max(0.0);
            // Half a day back is the next day; less is an error.
            seconds += DAY * if days.fract() > 0.5 { days.ceil() } else { days.floor() };
        }
        self.later(seconds, "; sort the record")
    }
}
