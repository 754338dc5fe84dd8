//! Estimates where multiple shooting follows the measurements and one simulation of a whole record does not.

use super::further::leaves_unexplained;
use super::refine::{Start, is_only_coarse};
use super::shooting::Shot;
use super::staged::note;
use super::stages::Led;
use crate::error::Error;
use crate::estimate::{Summary, Unknown, WarningCode};
use crate::numeral::number;
use crate::problem::{Control, Problem, Role};
use crate::record::{Initial, Record};
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
        match led.filter(|led| led.explains() && leaves_unexplained(&found)) {
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
        // A late input takes values from before the piece, which a slice of the record does not have.
        let parameters: Vec<f64> = self.unknowns.parameters.iter().map(|parameter| parameter.start).collect();
        if !self.sweep.late(&parameters).is_empty() {
            return None;
        }
        let (shot, begin) = (led.shot.as_ref()?, Instant::now());
        // No more pieces than there are between nodes.
        let most = shot.nodes.iter().map(|nodes| nodes.len() + 1).max()?.min(MOST);
        let counts = std::iter::successors(Some(2), |count| Some(2 * count));
        for count in counts.take_while(|count| count / 2 < most && !own) {
            if control.stops() {
                break;
            }
            let begins: Vec<Begin> =
                shot.nodes.iter().enumerate().flat_map(|(e, nodes)| begins(e, nodes, count)).collect();
            let Some((method, problem, parts)) = self.usable(found, (&begins, shot), begin, control) else { continue };
            let evaluations = found.evaluations + parts.evaluations;
            let seconds = found.seconds + begin.elapsed().as_secs_f64();
            // A simulation of a whole record may overflow.
            let whole = method.estimate_at(&self.of_pieces(&begins, &parts), "multiple shooting");
            let is_whole = whole.is_ok();
            let whole = whole.map(|whole| {
                let staged = found.warnings.iter().filter(|warning| warning.code == WarningCode::Staged).cloned();
                Summary { warnings: whole.warnings.iter().cloned().chain(staged).collect(), ..whole }
            });
            let whole = whole.unwrap_or_else(|_| found.clone());
            let mut whole = Summary { iterations: found.iterations, evaluations, seconds, ..whole };
            whole.warnings.push(note(said(&parts, problem.records(), is_whole)));
            return Some(whole);
        }
        None
    }

    /// A usable estimate of the pieces, by the integration method of `found`, or a finer one where only its step is too coarse; before it this problem
    /// by that method, and the problem of the pieces.
    fn usable(
        &self,
        found: &Summary,
        (begins, shot): (&[Begin], &Shot),
        begin: Instant,
        control: &Control,
    ) -> Option<(&Problem<'_>, Problem<'_>, Summary)> {
        for method in self.by_method().skip(found.method.refinement) {
            let (problem, coordinates) = self.cut_at(begins, &shot.coordinates, method).ok()?;
            let start = Start { coordinates, ..Start::declared(&problem) };
            let parts = problem.run_within(begin, control, start).ok()?;
            if parts.severity() < Severity::NotUsable {
                return Some((method, problem, parts));
            }
            if !is_only_coarse(&parts) || control.stops() {
                break;
            }
        }
        None
    }

    /// The problem of pieces of the records by a method, and the point of this one there.
    fn cut_at<'p>(
        &'p self,
        begins: &[Begin],
        coordinates: &[f64],
        method: &'p Problem<'p>,
    ) -> Result<(Problem<'p>, Vec<f64>), Error> {
        let ends = begins.iter().skip(1).map(Some).chain([None]);
        let end = |e: usize, next: Option<&Begin>| match next {
            Some((other, first, _)) if *other == e => *first,
            _ => self.records[e].len(),
        };
        let piece = |((e, first, _), next): (&Begin, Option<&Begin>)| {
            let piece = self.records[*e].slice(*first..end(*e, next))?;
            // A later one begins at its node, and not at a measurement.
            if *first > 0 { piece.initial(Initial::Free) } else { Ok(piece) }
        };
        let pieces: Vec<Record> = begins.iter().zip(ends).map(piece).collect::<Result<_, _>>()?;
        let settings = self.settings.beside(self.settings.noise.clone());
        let problem = Problem::new(method.sweep.clone(), pieces, &self.unknowns.parameters, settings)?;
        let problem = Problem { refines: self.refines, method: method.method, steps: method.steps, ..problem };
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
fn said(parts: &Summary, pieces: &[Record], is_whole: bool) -> String {
    let parameters = parts.unknowns.iter().filter(|unknown| matches!(unknown.role, Role::Parameter(_)));
    let one = |unknown: &Unknown| {
        let error =
            unknown.knowledge.standard_error().map_or_else(String::new, |error| format!(" +- {}", number(error, 2)));
        format!("`{}` = {}{error}", unknown.name, number(unknown.value, 5))
    };
    let parameters: Vec<String> = parameters.map(one).collect();
    let (count, longest) = (pieces.len(), pieces.iter().map(Record::len).max().unwrap_or_default());
    let (cannot, whose) = match is_whole {
        true => ("does not", format!("The estimate is that of {count} pieces with an initial state each, which are")),
        false => ("cannot be run", format!("A fit of {count} pieces with an initial state each is")),
    };
    format!(
        "multiple shooting follows the measurements, and one simulation of a whole record {cannot}: the plant is chaotic or unstable. {whose} \
         usable (standard errors: {}); fit pieces of at most {longest} samples (Experiment::slice) for their verdict, intervals and residuals",
        parameters.join(", ")
    )
}
