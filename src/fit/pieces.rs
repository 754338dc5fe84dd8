//! Estimates where multiple shooting follows the measurements and one simulation of a whole record does not.

use super::elsewhere::leaves_unexplained;
use super::refine::Start;
use super::staged::note;
use super::stages::Led;
use crate::error::Error;
use crate::estimate::{Summary, Unknown, WarningCode};
use crate::numeral::number;
use crate::problem::{Control, Problem, Role};
use crate::record::Record;
use crate::severity::Severity;
use std::time::Instant;

/// A record is cut in two, four and so on, up to so many pieces.
const MOST: usize = 64;

/// A piece of a record: the record, its first sample, and the state there, if it is not the first piece.
type Begin = (usize, usize, Option<Vec<f64>>);

impl Problem<'_> {
    /// An estimate that leaves an output unexplained, or, where multiple shooting explains all of them, that of the records in the fewest pieces with
    /// which an estimate is usable, each with an initial state of its own. Its parameters are right, but one simulation of a whole record with them is
    /// not near the measurements for long (it is chaotic, or unstable): the verdict is that of the whole records, and a note has that of the pieces.
    pub(super) fn or_by_pieces(&self, found: Summary, led: Option<&Led>, control: &Control) -> Summary {
        let explained = led.filter(|led| led.shot.as_ref().is_some_and(|shot| shot.explains()));
        match explained.filter(|_| leaves_unexplained(&found)) {
            Some(led) => self.by_pieces(&found, led, control).unwrap_or(found),
            None => found,
        }
    }

    fn by_pieces(&self, found: &Summary, led: &Led, control: &Control) -> Option<Summary> {
        let own = self
            .unknowns
            .row
            .iter()
            .any(|unknown| matches!(unknown.role, Role::Parameter(_)) && unknown.experiment.is_some());
        let (shot, begin) = (led.shot.as_ref()?, Instant::now());
        let counts = std::iter::successors(Some(2), |count| Some(2 * count));
        for count in counts.take_while(|count| *count <= MOST && !own) {
            if control.stops() {
                break;
            }
            let begins: Vec<Begin> =
                shot.nodes.iter().enumerate().flat_map(|(e, nodes)| begins(e, nodes, count)).collect();
            let (problem, coordinates) = self.cut_at(&begins, &shot.coordinates).ok()?;
            let start = Start { coordinates, ..Start::declared(&problem) };
            let Ok(parts) = problem.run_within(begin, control, start) else { continue };
            if parts.severity() == Severity::NotUsable {
                continue;
            }
            let whole = self.estimate_at(&self.of_pieces(&begins, &parts), "multiple shooting").ok()?;
            let (evaluations, seconds) =
                (found.evaluations + parts.evaluations, found.seconds + begin.elapsed().as_secs_f64());
            let mut whole = Summary { iterations: found.iterations, evaluations, seconds, ..whole };
            whole.warnings.extend(found.warnings.iter().filter(|warning| warning.code == WarningCode::Staged).cloned());
            whole.warnings.push(note(said(&parts, problem.records())));
            return Some(whole);
        }
        None
    }

    /// The problem of pieces of the records, and the point of this one there.
    fn cut_at(&self, begins: &[Begin], coordinates: &[f64]) -> Result<(Problem<'_>, Vec<f64>), Error> {
        let ends = begins.iter().skip(1).map(Some).chain([None]);
        let end = |e: usize, next: Option<&Begin>| match next {
            Some((other, first, _)) if *other == e => *first,
            _ => self.records[e].len(),
        };
        let pieces = begins.iter().zip(ends).map(|((e, first, _), next)| self.records[*e].slice(*first..end(*e, next)));
        let pieces: Vec<Record> = pieces.collect::<Result<_, _>>()?;
        let settings = self.settings.beside(self.settings.noise.clone());
        let problem = Problem::new(self.sweep.clone(), pieces, &self.unknowns.parameters, settings)?;
        let of = |i: usize| {
            let unknown = &problem.unknowns.row[i];
            let known = unknown.experiment.map(|piece| &begins[piece]);
            match (unknown.role, known) {
                (Role::InitialState(s), Some((_, _, Some(state)))) => state[s],
                (role, known) => self.coordinate(coordinates, role, known.map(|(e, _, _)| *e)),
            }
        };
        let point = (0..problem.unknowns.row.len()).map(of).collect();
        Ok((problem, point))
    }

    /// The coordinate of the unknown of this role; of an initial state, of this record.
    fn coordinate(&self, coordinates: &[f64], role: Role, e: Option<usize>) -> f64 {
        let row = &self.unknowns.row;
        row.iter().position(|one| one.role == role && one.experiment == e).map_or(0.0, |i| coordinates[i])
    }

    /// The point of this problem in an estimate of its pieces: the initial states are those of the first pieces.
    fn of_pieces(&self, begins: &[Begin], parts: &Summary) -> Vec<f64> {
        let coordinates = parts.coordinates();
        let of = |i: usize| {
            let unknown = &self.unknowns.row[i];
            let piece = unknown.experiment.map(|e| begins.iter().position(|(of, _, _)| *of == e).unwrap_or_default());
            let same = |other: &Unknown| other.role == unknown.role && other.experiment == piece;
            let found = parts.unknowns.iter().position(same);
            found.map_or(unknown.parameter.transform.to_coordinate(unknown.parameter.start), |i| coordinates[i])
        };
        (0..self.unknowns.row.len()).map(of).collect()
    }
}

/// Where about so many pieces of a record begin, each but the first at a node.
fn begins(e: usize, nodes: &[(usize, Vec<f64>)], count: usize) -> Vec<Begin> {
    let count = count.min(nodes.len() + 1);
    let at = |k: usize| &nodes[k * (nodes.len() + 1) / count - 1];
    let later = (1..count).map(|k| (e, at(k).0, Some(at(k).1.clone())));
    std::iter::once((e, 0, None)).chain(later).collect()
}

/// What the pieces say of the parameters.
fn said(parts: &Summary, pieces: &[Record]) -> String {
    let parameters = parts.unknowns.iter().filter(|unknown| matches!(unknown.role, Role::Parameter(_)));
    let one = |unknown: &Unknown| {
        let error =
            unknown.knowledge.standard_error().map_or_else(String::new, |error| format!(" +- {}", number(error, 2)));
        format!("`{}` = {}{error}", unknown.name, number(unknown.value, 5))
    };
    let parameters: Vec<String> = parameters.map(one).collect();
    let (count, longest) = (pieces.len(), pieces.iter().map(Record::len).max().unwrap_or_default());
    format!(
        "multiple shooting follows the measurements, and one simulation of a whole record does not: the plant is chaotic or unstable. The estimate \
         is that of {count} pieces with an initial state each, which are usable (standard errors: {}); fit pieces of at most {longest} \
         samples (Experiment::slice) for their verdict, intervals and residuals",
        parameters.join(", ")
    )
}
