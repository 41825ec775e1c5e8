//! Ids and indices of a sweep's runs: which stand in it twice, and by which version of the model they are.

use super::super::catalogue::{Layout, id_number};
use super::super::schema::Kind;
use crate::domain::document::Document;
use crate::domain::identity::MODEL_VERSIONS;
use crate::domain::sweep::Limits;
use std::collections::HashMap;

/// Ids and indices of a sweep's runs.
#[derive(Debug, Default)]
pub struct Runs {
    /// Index at which a run stands first, by its id.
    pub first: HashMap<u128, i64>,
    /// Runs that stand in the sweep before, and where.
    pub again: Vec<(i64, i64)>,
    /// Index and id, ascending.
    pub ids: Vec<(i64, u128)>,
}

impl Runs {
    /// Those of a layout that tells the runs of every piece.
    pub fn of(layouts: &[(Kind, Layout)]) -> Self {
        let of_runs = layouts.iter().filter(|(kind, _)| *kind == Kind::Runs);
        let pieces = of_runs.flat_map(|(_, layout)| layout.groups.iter().flatten());
        let mut wanted: Vec<(i64, u128)> = pieces
            .flat_map(|piece| piece.wanted.iter().flatten().map(|(id, index)| (*index, *id)))
            .collect();
        wanted.sort_unstable();
        let mut runs = Self::default();
        for (index, id) in wanted {
            runs.add(index, id);
        }
        runs
    }

    /// Adds a run; in the order of the indices.
    pub fn add(&mut self, index: i64, id: u128) {
        self.ids.push((index, id));
        let first = *self.first.entry(id).or_insert(index);
        if first != index {
            self.again.push((index, first));
        }
    }

    /// Leaves each run in a long table once, so that its rows belong to one run of its id.
    pub fn keep_first(&self, layout: &mut Layout) {
        for piece in layout.groups.iter_mut().flatten() {
            if let Some(wanted) = &mut piece.wanted {
                wanted.retain(|(id, index)| self.first.get(id) == Some(index));
            }
        }
    }

    /// The version of the model by which every run has its id; none if there is no such version.
    pub fn model_version(&self, document: &str) -> Option<&'static str> {
        let sweep = Document::parse(document).and_then(|d| d.into_sweep(&Limits::MOST)).ok()?;
        MODEL_VERSIONS.into_iter().find(|version| {
            self.ids.iter().all(|(index, id)| {
                let index = *index as usize;
                index < sweep.count()
                    && id_number(&sweep.run(index).id_of_model(Some(version))) == Some(*id)
            })
        })
    }
}
