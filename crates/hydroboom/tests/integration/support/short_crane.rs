//! A crane whose motion takes a few seconds.

use std::path::Path;

/// The paper's crane with a short and slow motion, under another name.
pub fn short_crane(folder: &Path) -> String {
    let mut text = hydroboom_description::UIA_SINGLE_BOOM.to_string();
    for (from, to) in [
        ("name = \"UiA single boom\"", "name = \"short\""),
        ("start_mm  = { value = 50.0", "start_mm  = { value = 200.0"),
        ("end_mm    = { value = 450.0", "end_mm    = { value = 240.0"),
        ("fast_mm_s = { value = 120.0", "fast_mm_s = { value = 60.0"),
        ("ramp_s    = { value = 1.0", "ramp_s    = { value = 0.5"),
        ("dwell_s   = { value = 5.0", "dwell_s   = { value = 0.5"),
        ("rest_s    = { value = 2.0", "rest_s    = { value = 0.5"),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    let file = folder.join("short.toml");
    std::fs::write(&file, text).expect("a file");
    file.display().to_string()
}
