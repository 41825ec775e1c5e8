//! The runs of one chunk, solved again in the order in which they began from each other, and compared.

use super::super::host;
use super::super::solve::{Beginning, Walker};
use super::{Repeated, Verdict, Work};
use crate::archive::SolvedRun;
use crate::archive::catalogue::Entry;
use crate::archive::likeness::Likeness;
use crate::archive::recall::{Origin, Recalled};
use crate::archive::schema::Kind;
use crate::domain::outcome::{Outcome, SCALARS};
use crate::domain::provenance::{PROGRAM_VERSION, STARTS, scenario};
use crate::domain::run::RunSpec;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Solves the wanted runs again, on the pool on one of whose threads this is called.
pub(super) fn all(work: &Work, tolerance: f64) -> Vec<Repeated> {
    let forest = Forest::new(work);
    let trees: Vec<Vec<Repeated>> =
        forest.roots.par_iter().map(|root| forest.repeat(root, tolerance)).collect();
    trees.into_iter().flatten().collect()
}

/// A run that is not compared.
pub(super) fn not_compared(entry: &Entry, why: &str) -> Repeated {
    Repeated {
        run_id: entry.row.text("run_id").to_owned(),
        run_index: entry.row.whole("run_index").unwrap_or_default() as i64,
        verdict: Verdict::NotCompared,
        is_same_build: false,
        largest: None,
        detail: Some(why.to_owned()),
    }
}

/// The wanted runs and all that they began from: a tree hangs on each run that began from its own start.
struct Forest<'a> {
    work: &'a Work,
    wanted: HashMap<&'a str, Vec<&'a Entry>>,
    origins: HashMap<String, Origin>,
    roots: Vec<String>,
    children: HashMap<String, Vec<String>>,
}

impl<'a> Forest<'a> {
    fn new(work: &'a Work) -> Self {
        let mut wanted: HashMap<&str, Vec<&Entry>> = HashMap::new();
        for entry in &work.entries {
            // A point may stand in a sweep twice.
            wanted.entry(entry.row.text("run_id")).or_default().push(entry);
        }
        let (origins, roots, children) = Default::default();
        let mut forest = Self { work, wanted, origins, roots, children };
        for entry in &work.entries {
            forest.add(entry.row.text("run_id"));
        }
        forest
    }

    /// Adds a run and what it began from, as far as that is in the chunk's files.
    fn add(&mut self, run_id: &str) {
        let mut next = Some(run_id.to_owned());
        while let Some(id) = next.take() {
            if self.origins.contains_key(&id) {
                return;
            }
            let Some(origin) = self.work.recalled.origin(&id) else {
                if !self.roots.contains(&id) {
                    self.roots.push(id);
                }
                return;
            };
            let from = origin.provenance.started_from.clone();
            self.origins.insert(id.clone(), origin);
            match from.filter(|from| self.work.recalled.rows(Kind::Runs, from).is_some()) {
                Some(from) => {
                    self.children.entry(from.clone()).or_default().push(id);
                    next = Some(from);
                }
                None => self.roots.push(id),
            }
        }
    }

    /// A tree, from its root up.
    fn repeat(&self, root: &str, tolerance: f64) -> Vec<Repeated> {
        let mut repeated = Vec::new();
        // Each with the way that it began from.
        let mut next: Vec<(&str, Option<Arc<Beginning>>)> = vec![(root, None)];
        while let Some((run_id, from)) = next.pop() {
            let entries = self.wanted.get(run_id).into_iter().flatten();
            let mut way = None;
            match self.run(run_id) {
                Ok((origin, run)) => {
                    let mut again = Again::new(origin, run, from.as_deref());
                    if self.wanted.contains_key(run_id) {
                        let solved = again.compared(self.work, run_id, tolerance, entries);
                        repeated.extend(solved);
                    } else {
                        again.walker.find_way(&again.run, &|| false);
                    }
                    way = again.walker.way().filter(|_| again.is_from_its_start);
                }
                Err(why) => repeated.extend(entries.map(|entry| not_compared(entry, &why))),
            }
            let way = way.map(Arc::new);
            let children = self.children.get(run_id).into_iter().flatten();
            next.extend(children.map(|child| (child.as_str(), way.clone())));
        }
        repeated
    }

    /// A run from its row, or why there is none.
    fn run(&self, run_id: &str) -> Result<(&Origin, RunSpec), String> {
        let origin = self.origins.get(run_id).ok_or("its row is not in its chunk's file")?;
        let options = origin.provenance.options.as_deref().or(self.work.options.as_deref());
        let options = options.ok_or("neither its row nor a sweep tells its options")?;
        let document = scenario(options, &origin.upstream_closure, &origin.parameters)
            .ok_or("its options cannot be read")?;
        let run = document.into_run().map_err(|refusal| format!("it is refused: {refusal}"))?;
        if run.id_of_model(origin.provenance.model_version.as_deref()) != run_id {
            let why = "what is stored of it has another identity: parameters or options have been altered, or \
                       an older version of the model solved it";
            return Err(why.into());
        }
        Ok((origin, run))
    }
}

/// A run about to be solved again.
struct Again<'a> {
    origin: &'a Origin,
    run: RunSpec,
    walker: Walker,
    /// Whether that begins from what it began from.
    is_from_its_start: bool,
}

impl<'a> Again<'a> {
    fn new(origin: &'a Origin, run: RunSpec, from: Option<&Beginning>) -> Self {
        let [own, neighbour, _] = STARTS;
        let start = origin.provenance.start;
        let (walker, is_from_its_start) = match (start, from) {
            (Some(start), Some(from)) if start != own => {
                (Walker::beginning(from, start == neighbour), true)
            }
            // From its own start too the same state is found.
            _ => (Walker::default(), start == Some(own)),
        };
        Self { origin, run, walker, is_from_its_start }
    }

    /// Solves it and compares it with what is stored, under each of its indices.
    fn compared<'b>(
        &mut self,
        work: &Work,
        run_id: &str,
        tolerance: f64,
        entries: impl Iterator<Item = &'b &'b Entry>,
    ) -> Vec<Repeated> {
        let start = work.start.as_ref().map_err(String::as_str);
        let outcome = self.walker.solve(&self.run, start, &|| false);
        let solved = outcome.map(|outcome| now(run_id, outcome));
        entries
            .map(|entry| match &solved {
                Some(solved) => self.verdict(&work.recalled, entry, run_id, solved, tolerance),
                None => not_compared(entry, "the solver stopped before its end"),
            })
            .collect()
    }

    fn verdict(
        &self,
        recalled: &Recalled,
        entry: &Entry,
        run_id: &str,
        now: &[SolvedRun],
        tolerance: f64,
    ) -> Repeated {
        let likeness = likeness(recalled, entry, run_id, now);
        let made = &self.origin.provenance;
        let is_same_build = self.is_from_its_start
            && made.program_version.as_deref() == Some(PROGRAM_VERSION)
            && made.host_class.as_deref() == Some(host::class());
        let verdict = if likeness.is_bitwise() {
            Verdict::Bitwise
        } else if !is_same_build && likeness.is_within(tolerance) {
            Verdict::Within
        } else {
            Verdict::Differs
        };
        let Likeness { largest, other, way } = likeness;
        let run_index = entry.row.whole("run_index").unwrap_or_default() as i64;
        let (run_id, detail) = (run_id.to_owned(), other.or(way));
        Repeated { run_id, run_index, verdict, is_same_build, largest, detail }
    }
}

fn now(run_id: &str, outcome: Outcome) -> [SolvedRun; 1] {
    [SolvedRun { run_index: 0, run_id: run_id.to_owned(), outcome }]
}

/// How like what comes out now is what is stored, in every table and in the catalogue.
fn likeness(recalled: &Recalled, entry: &Entry, run_id: &str, now: &[SolvedRun]) -> Likeness {
    let mut likeness = Likeness::default();
    for kind in Kind::ALL {
        let now = kind.batch(now);
        match recalled.rows(kind, run_id) {
            Some(stored) => likeness.compare(kind, &stored, &now),
            None if now.num_rows() > 0 => {
                let other = format!("{}: no rows stored, {} now", kind.name(), now.num_rows());
                likeness.other.get_or_insert(other);
            }
            None => {}
        }
    }
    for (name, stored) in recalled.description(run_id) {
        let listed = entry.row.0.get(name).cloned().unwrap_or_default();
        if listed != stored {
            let other = format!("{name}: {listed} in the catalogue, {stored} in the file");
            likeness.other.get_or_insert(other);
        }
    }
    let numbers = recalled.numbers(run_id);
    for info in SCALARS {
        let listed = (info.get)(&entry.scalars);
        if let Some(stored) = numbers.get(info.name).copied().filter(|stored| *stored != listed) {
            let told = |v: Option<f64>| v.map_or("none".to_owned(), |v| v.to_string());
            let (name, listed, stored) = (info.name, told(listed), told(stored));
            let other = format!("{name}: {listed} in the catalogue, {stored} in the file");
            likeness.other.get_or_insert(other);
        }
    }
    likeness
}
