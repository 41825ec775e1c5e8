//! `melange rerun`: stored runs solved again and compared with what is stored of them.

use super::reach::REFUSED;
use super::serve::threads;
use crate::store::Onlooker;
use crate::worker::rerun::{Plan, Repeated, Repeater, Verdict};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `melange rerun`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// A run's or a sweep's id.
    id: String,
    /// Compare with what is stored, and keep nothing of it; there is no other mode.
    #[arg(long, required = true)]
    check: bool,
    /// Data directory; it may be in use, and is only read.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
    /// Only so many runs of a sweep, drawn at random.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    sample: Option<u32>,
    /// Another seed draws others.
    #[arg(long, default_value_t = 0, requires = "sample")]
    seed: u64,
    /// Largest relative difference of a number of a run that another build or another class of host solved.
    #[arg(long, default_value_t = 1e-9, value_parser = tolerance)]
    tolerance: f64,
    /// Threads that solve; all of the machine's if not given.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    workers: Option<u16>,
    /// How the comparison is printed.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    Text,
    Json,
}

/// Exit code of runs that are not what is stored.
const DIFFERS: u8 = 1;

/// A number that may be a tolerance.
fn tolerance(text: &str) -> Result<f64, String> {
    let number: Option<f64> = text.parse().ok();
    number.filter(|t| (0.0..1.0).contains(t)).ok_or("a number from 0, below 1".into())
}

/// Solves again, compares and prints.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let onlooker = Onlooker::open(&arguments.data).await?;
    let sample = arguments.sample.map(|n| (n as usize, arguments.seed));
    let Some(plan) = Plan::of(&onlooker, &arguments.id, sample).await? else {
        let data = arguments.data.display();
        eprintln!("refused: neither a run nor a sweep in {data} has the id {}", arguments.id);
        return Ok(ExitCode::from(REFUSED));
    };
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {per_sec}, {eta} left")?;
    let bar = ProgressBar::new(plan.count() as u64).with_style(style);
    let repeater = Repeater::new(onlooker, threads(arguments.workers), arguments.tolerance)?;
    let repeated = repeater.repeat(plan, |done| bar.set_position(done as u64)).await?;
    bar.finish_and_clear();
    let verdicts = [Verdict::Bitwise, Verdict::Within, Verdict::Differs, Verdict::NotCompared];
    let [bitwise, within, differ, not_compared] =
        verdicts.map(|verdict| repeated.iter().filter(|run| run.verdict == verdict).count());
    let (count, tolerance) = (repeated.len(), arguments.tolerance);
    let shown = match arguments.format {
        Format::Text => format!(
            "{}{count} runs: {bitwise} bitwise equal, {within} within {tolerance:e}, {differ} differ, \
             {not_compared} not compared\n",
            text(&repeated, tolerance),
        ),
        Format::Json => {
            let told = json!({
                "count": count, "bitwise": bitwise, "within": within, "differs": differ,
                "not_compared": not_compared, "tolerance": tolerance, "runs": repeated,
            });
            format!("{told}\n")
        }
    };
    std::io::stdout().write_all(shown.as_bytes())?;
    let is_fine = differ + not_compared == 0;
    Ok(if is_fine { ExitCode::SUCCESS } else { ExitCode::from(DIFFERS) })
}

/// A line for each run.
fn text(repeated: &[Repeated], tolerance: f64) -> String {
    let mut text = String::new();
    for run in repeated {
        let largest = run.largest.as_ref().map(|d| {
            format!(
                "largest relative difference {:.1e}, of {} ({} stored, {} now)",
                d.relative, d.name, d.stored, d.now
            )
        });
        let told: Vec<String> = largest.into_iter().chain(run.detail.clone()).collect();
        let told = told.join("; ");
        let line = match run.verdict {
            Verdict::Bitwise => "bitwise equal".to_owned(),
            Verdict::Within => format!("within {tolerance:e}: {told}"),
            Verdict::Differs if run.is_same_build => {
                format!("differs, though build, host and start are the same: {told}")
            }
            Verdict::Differs => format!("differs: {told}"),
            Verdict::NotCompared => format!("not compared: {told}"),
        };
        text += &format!("{:>8} {}  {line}\n", run.run_index, run.run_id);
    }
    text
}
