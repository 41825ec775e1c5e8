//! The report as the document in `docs/`: figure by figure its picture and its claims, then the rest.

use super::pictures::{FIGURES, FOLDER, Figure};
use super::{Claim, Report, verdict};
use std::fmt::Write;

/// How the document begins.
const PREFACE: &str = "\
# The paper's figures and claims, run again

Written by `melange reproduce --out DIR`, with the pictures beside it and the figures' data as CSV; a test keeps it so. The pictures are drawn from
the archive that the command leaves in `DIR/archive`: `melange serve --data DIR/archive` shows the same runs in the dashboard.

The paper is Amundson, Robel, Burton and Nissanka ([The Cryosphere 19, 19–35, 2025](https://doi.org/10.5194/tc-19-19-2025)). Where nothing else
is said, runs have the paper's settings, its grid (N = 50) and the closure of its figures, `published`. A claim is judged by the numbers beside it
alone.
";

impl Claim {
    /// The paper's figure that it is about: by its name, else the first one that its place names.
    fn figure(&self) -> Option<usize> {
        let number = |text: &str| text.chars().next()?.to_digit(10).map(|digit| digit as usize);
        let by_name = self.id.strip_prefix("fig").and_then(number);
        let by_place =
            || ["Fig. ", "Figs. "].iter().find_map(|f| number(self.place.split_once(f)?.1));
        by_name.or_else(by_place)
    }
}

impl Report {
    /// As the document in `docs/`.
    pub fn as_markdown(&self) -> String {
        let mut text = format!("{PREFACE}\n**{}**\n", self.tally());
        for figure in FIGURES {
            let Figure { number, title, caption } = figure;
            let path = format!("{FOLDER}/{}", figure.file());
            write!(
                text,
                "\n## Fig. {number}: {title}\n\n![Fig. {number}: {title}]({path})\n\n{caption}\n"
            )
            .expect("memory");
            text += &table(self.claims.iter().filter(|claim| claim.figure() == Some(number)));
        }
        let drawn = |claim: &&Claim| FIGURES.iter().any(|f| claim.figure() == Some(f.number));
        text += "\n## Claims that no figure shows\n";
        text += &table(self.claims.iter().filter(|claim| !drawn(claim)));
        for table in &self.tables {
            write!(text, "\n## {}\n\n{}\n\n{}", table.title, table.caption, table.as_markdown())
                .expect("memory");
        }
        text
    }
}

/// Claims with what comes out.
fn table<'a>(claims: impl Iterator<Item = &'a Claim>) -> String {
    let mut text =
        "\n| where | what the paper says | what comes out | verdict |\n|---|---|---|---|\n"
            .to_owned();
    for claim in claims {
        let verdict = if claim.holds {
            verdict(true).to_owned()
        } else {
            format!("**{}**: {}", verdict(false), claim.if_not)
        };
        let Claim { place, paper, .. } = claim;
        writeln!(text, "| {place} | {paper} | {} | {verdict} |", claim.found()).expect("memory");
    }
    text
}
