//! Drawn figure with its picture, its data, and a text alternative.

use maud::{Markup, PreEscaped, html};
use std::fmt::Write;

/// Drawn figure: picture, data, and text alternative.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// Picture as an SVG element.
    pub svg: String,
    /// Data as CSV: a column per line if all have the same abscissae, else a row per point with the name of
    /// its line.
    pub csv: String,
    /// Text alternative for screen readers: description of axes and lines.
    pub says: String,
}

/// Markers of the data between a figure's picture and its caption, until the page is written.
const BEGIN: &str = "<template class=\"data\">";
const END: &str = "</template>";

/// Figure of a page as separate files, picture and data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FigureFile {
    /// Name for the files: number and first words of the caption.
    pub name: String,
    /// Picture as the text of an SVG file.
    pub svg: String,
    /// Data as the text of a CSV file.
    pub csv: String,
}

/// HTML element of a figure with its caption.
pub fn figure(caption: &str, drawing: &Drawing) -> Markup {
    let label = html! { (caption) " " (drawing.says) }.into_string();
    let svg = drawing.svg.replacen(
        "role=\"img\"",
        &format!("role=\"img\" aria-label=\"{}\"", label.replace('"', "&quot;")),
        1,
    );
    html! {
        figure {
            div.drawn { (PreEscaped(svg)) }
            (PreEscaped(BEGIN)) (drawing.csv) (PreEscaped(END))
            figcaption { (caption) }
        }
    }
}

/// Body of a page without the data of its figures, and the figures.
pub(super) fn apart(body: &str) -> (String, Vec<FigureFile>) {
    let (mut shown, mut figures) = (String::with_capacity(body.len() / 2), Vec::new());
    let mut rest = body;
    while let Some((before, after)) = rest.split_once(BEGIN) {
        let (data, after) = after.split_once(END).unwrap_or((after, ""));
        shown += before;
        let svg = before.rfind("<svg").map_or("", |at| &before[at..]);
        let svg = svg.trim_end().trim_end_matches("</div>");
        let caption =
            after.split_once("<figcaption>").and_then(|(_, c)| c.split_once("</figcaption>"));
        let caption = unescaped(caption.map_or("", |(caption, _)| caption));
        figures.push(FigureFile {
            name: format!("{:02}-{}", figures.len() + 1, slug(&caption)),
            svg: standing_alone(svg),
            csv: unescaped(data),
        });
        rest = after;
    }
    shown += rest;
    (shown, figures)
}

/// Picture as a standalone file in the colours of the light page.
fn standing_alone(svg: &str) -> String {
    let svg = match svg.contains("xmlns=") {
        true => svg.to_string(),
        false => svg.replacen("<svg", "<svg xmlns=\"http://www.w3.org/2000/svg\"", 1),
    };
    let style = "<style>svg{--ink:#1c1f24;--paper:#fff;--grid:#d9dce1;--soft:#5c6470;background:#fff}</style>";
    svg.replacen('>', &format!(">{style}"), 1)
}

fn unescaped(text: &str) -> String {
    text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&amp;", "&")
}

/// First words of a caption, for a file name.
fn slug(caption: &str) -> String {
    let words = caption.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty());
    let words: Vec<String> = words.take(6).map(str::to_ascii_lowercase).collect();
    words.join("-")
}

/// Cell of a CSV file.
fn cell(text: &str) -> String {
    match text.contains([',', '"', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.into(),
    }
}

/// Lines as CSV.
pub(super) fn lines_as_csv<'a>(
    x: &str,
    y: &str,
    lines: impl Iterator<Item = (&'a str, &'a [(f64, f64)])>,
) -> String {
    let lines: Vec<_> = lines.collect();
    let mut csv = String::new();
    let is_same = |other: &[(f64, f64)]| {
        other.len() == lines[0].1.len()
            && other.iter().zip(lines[0].1).all(|(a, b)| a.0.to_bits() == b.0.to_bits())
    };
    // writing to a String cannot fail
    if !lines.is_empty() && lines.iter().all(|(_, points)| is_same(points)) {
        let names: Vec<String> =
            lines.iter().map(|(name, _)| cell(&format!("{name}: {y}"))).collect();
        let _ = writeln!(csv, "{},{}", cell(x), names.join(","));
        for (k, (at, _)) in lines[0].1.iter().enumerate() {
            let values: Vec<String> =
                lines.iter().map(|(_, points)| format!("{:e}", points[k].1)).collect();
            let _ = writeln!(csv, "{at:e},{}", values.join(","));
        }
        return csv;
    }
    let _ = writeln!(csv, "line,{},{}", cell(x), cell(y));
    for (name, points) in &lines {
        for (at, value) in *points {
            let _ = writeln!(csv, "{},{at:e},{value:e}", cell(name));
        }
    }
    csv
}

/// Table as CSV with a text column first.
pub(super) fn rows_as_csv(header: &[&str], rows: &[(&str, Vec<f64>)]) -> String {
    let mut csv = header.iter().map(|name| cell(name)).collect::<Vec<_>>().join(",") + "\n";
    for (name, values) in rows {
        let values: Vec<String> = values.iter().map(|v| format!("{v:e}")).collect();
        let _ = writeln!(csv, "{},{}", cell(name), values.join(","));
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_extracted_from_a_page_with_their_data() {
        let lines: [(&str, &[(f64, f64)]); 2] =
            [("a<b, c", &[(0.0, 1.0 / 3.0), (1.0, 2.0)]), ("d", &[(0.0, 3.0), (1.0, 4.0)])];
        let csv = lines_as_csv("t [s]", "x [mm]", lines.into_iter());
        assert_eq!(
            csv,
            "t [s],\"a<b, c: x [mm]\",d: x [mm]\n0e0,3.333333333333333e-1,3e0\n1e0,2e0,4e0\n"
                .replace("3.333333333333333e-1", &format!("{:e}", 1.0 / 3.0))
        );
        let svg = "<svg viewBox=\"0 0 1 1\" role=\"img\"><path/></svg>".to_string();
        let drawing = Drawing { svg, csv: csv.clone(), says: "Lines \"a\".".into() };
        let body =
            html! { p { "before" } (figure("Error & effort, RMS.", &drawing)) p { "after" } };
        let (shown, figures) = apart(&body.into_string());
        assert!(shown.starts_with("<p>before</p>") && shown.ends_with("<p>after</p>"), "{shown}");
        assert!(!shown.contains("template") && !shown.contains("3e0"), "{shown}");
        assert!(shown.contains("aria-label=\"Error &amp; effort, RMS. Lines &quot;a&quot;.\""));
        assert_eq!(figures.len(), 1);
        assert_eq!(figures[0].name, "01-error-effort-rms");
        assert_eq!(figures[0].csv, csv);
        assert!(figures[0].svg.starts_with("<svg xmlns=") && figures[0].svg.ends_with("</svg>"));
        let long =
            lines_as_csv("t", "x", [("a", &[(0.0, 1.0)][..]), ("b", &[(2.0, 1.0)])].into_iter());
        assert_eq!(long, "line,t,x\na,0e0,1e0\nb,2e0,1e0\n");
    }
}
