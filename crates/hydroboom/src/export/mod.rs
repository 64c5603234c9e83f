//! `hydroboom export`

mod c;
mod closed_loop;
mod count;
mod fmu;
mod st;

use crate::output;
use clap::{Args, Subcommand};
use hydroboom_description::Description;
use hydroboom_design::stability::{benchmark_stability, scheduled_lqr_stability};
use hydroboom_export::{Block, ExportError, Plan};
use hydroboom_measurement::digest_of;
use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Write model and controllers as source code for other systems.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom export count\n  hydroboom export st --crane my-crane.toml --out generated\n  hydroboom export c --crane my-crane.toml --out generated\n  hydroboom export fmu --what model --out crane.fmu\n  hydroboom export closed-loop"
)]
pub struct Export {
    #[command(subcommand)]
    target: Target,
}

#[derive(Subcommand)]
enum Target {
    Count(count::Count),
    St(st::St),
    C(c::C),
    Fmu(fmu::Fmu),
    ClosedLoop(closed_loop::ClosedLoop),
}

impl Export {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// Those of the target.
    pub fn run(self) -> Result<()> {
        match self.target {
            Target::Count(command) => command.run(),
            Target::St(command) => command.run(),
            Target::C(command) => command.run(),
            Target::Fmu(command) => command.run(),
            Target::ClosedLoop(command) => command.run(),
        }
    }
}

/// Warns of exported controllers whose loop on the crane is unstable.
///
/// # Errors
///
/// If a loop cannot be linearised.
fn warn_of_unstable(crane: &Description) -> Result<()> {
    let loops = [
        benchmark_stability(crane, None).into_diagnostic()?,
        scheduled_lqr_stability(crane, None).into_diagnostic()?,
    ];
    for unstable in loops.iter().filter(|of| !of.stable) {
        output::warn(&unstable.to_string());
    }
    Ok(())
}

/// File to be written.
struct File {
    /// Name in its folder.
    name: String,
    content: String,
}

/// Writes files into a folder, which is created, and prints them with the operations of each call.
///
/// # Errors
///
/// If the order of computation of a block cannot be planned.
fn write_files(folder: &Path, files: &[File], blocks: &[Block], in_json: bool) -> Result<()> {
    output::folder(folder);
    let mut written: Vec<(PathBuf, &File)> = Vec::new();
    for file in files {
        let path = folder.join(&file.name);
        output::file(&path, file.content.as_bytes());
        // in a folder that could not be created no file was written, for any result of the write
        if output::is_written(&path) {
            written.push((path, file));
        }
    }
    let others = files_of_other_exports(folder, files);
    if !others.is_empty() {
        output::warn(&format!(
            "{} contains files of another export: {}",
            folder.display(),
            others.join(", ")
        ));
    }
    let flops = flops(blocks).into_diagnostic()?;
    if in_json {
        let files: Vec<Value> = written.iter().map(|(path, file)| {
            json!({ "file": path, "bytes": file.content.len(), "sha256": digest_of(file.content.as_bytes()) })
        }).collect();
        return output::json(&json!({ "files": files, "flops": flops.iter().map(|(name, flops)| {
            json!({ "entry": name, "flops": flops })
        }).collect::<Vec<_>>() }));
    }
    let rows: Vec<Vec<String>> = written
        .iter()
        .map(|(path, file)| {
            let path = path.display().to_string();
            let digest = digest_of(file.content.as_bytes());
            vec![path, file.content.len().to_string(), digest[..16].to_string()]
        })
        .collect();
    let mut text = match rows.is_empty() {
        true => "no file is written".into(),
        false => output::table(&["file", "bytes", "SHA-256"], &rows),
    };
    let costs: Vec<String> = flops.iter().map(|(name, flops)| format!("{name} {flops}")).collect();
    text += &format!("\nfloating-point operations a call: {}", costs.join(", "));
    output::text(&text)
}

/// Other files of the same kinds in a folder, left by an earlier export.
fn files_of_other_exports(folder: &Path, files: &[File]) -> Vec<String> {
    let kind = |name: &str| Path::new(name).extension().map(|e| e.to_os_string());
    let kinds: Vec<_> = files.iter().filter_map(|file| kind(&file.name)).collect();
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut others: Vec<String> = names
        .filter(|name| kind(name).is_some_and(|kind| kinds.contains(&kind)))
        .filter(|name| !files.iter().any(|file| file.name == *name))
        .collect();
    others.sort_unstable();
    others
}

/// Floating-point operations of each entry of the blocks.
fn flops(blocks: &[Block]) -> Result<Vec<(String, usize)>, ExportError> {
    let mut all = Vec::new();
    for block in blocks {
        let plan = Plan::of(block)?;
        for (entry, order) in block.entries.iter().zip(&plan.entries) {
            let count = hydroboom_export::Count::of(&block.graph, order);
            all.push((format!("{}.{}", block.name, entry.name), count.flops()));
        }
    }
    Ok(all)
}
