//! Frame of every page: one self-contained HTML file for light and dark display.

use super::drawing_data::{FigureFile, apart};
use super::origin::Origin;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = "
:root{--ink:#1c1f24;--paper:#fff;--grid:#d9dce1;--soft:#5c6470;--band:#f4f6f8;--alarm:#b3261e}
@media(prefers-color-scheme:dark){:root{--ink:#e6e8eb;--paper:#15181c;--grid:#3a4048;--soft:#a2a9b3;--band:#1e2329;--alarm:#ff8a80}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:60rem;padding:2rem 1rem 4rem;background:var(--paper);color:var(--ink);
font:16px/1.5 system-ui,sans-serif}
h1{font-size:1.7rem;margin:.2em 0}h2{margin:2.2em 0 .4em;font-size:1.25rem;border-bottom:1px solid var(--grid)}
h3{font-size:1.02rem;margin:1.4em 0 .2em}
table{border-collapse:collapse;margin:.6em 0;font-variant-numeric:tabular-nums;font-size:.92rem}
th,td{padding:.18em .7em;text-align:right;border-bottom:1px solid var(--grid)}
th:first-child,td:first-child{text-align:left}thead th{border-bottom:2px solid var(--soft)}
tr:nth-child(even) td{background:var(--band)}
.wide,body>table,details>table{display:block;max-width:100%;overflow-x:auto;scrollbar-width:thin;scrollbar-color:var(--soft) var(--band)}
.wide::-webkit-scrollbar{height:9px}.wide::-webkit-scrollbar-track{background:var(--band)}
.wide::-webkit-scrollbar-thumb{background:var(--soft);border-radius:5px}
.wide th:first-child,.wide td:first-child{position:sticky;left:0;background:var(--paper)}
.wide tr:nth-child(even) td:first-child{background:var(--band)}
.drawn svg{display:block;max-width:48rem;height:auto}
footer{margin-top:3rem;color:var(--soft);font-size:.92rem}
dl{display:grid;grid-template-columns:max-content 1fr;gap:.1em 1em}dd{margin:0;overflow-wrap:anywhere}
td.text{text-align:left}figure{margin:.8em 0}figcaption{color:var(--soft);font-size:.92rem}
.wide td:not(.text){white-space:nowrap}small,.soft{color:var(--soft)}.unstable{color:var(--alarm);font-weight:600}code{font-size:.92em;overflow-wrap:anywhere}
.pair{display:flex;flex-wrap:wrap;gap:0 1rem}.pair figure{flex:1 1 20rem;max-width:30rem}
details{margin:.6em 0}summary{cursor:pointer}";

/// HTML page of a report with its figures; it is written as a file with a record of its origin.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    /// Body without the data of the figures.
    body: String,
    /// Figures in their order on the page, as separate files.
    pub figures: Vec<FigureFile>,
}

/// HTML page of a title and a body, with style sheet for light and dark display.
pub fn document(title: &str, body: &Markup) -> Page {
    let (body, figures) = apart(&body.0);
    Page { title: title.into(), body, figures }
}

impl Page {
    /// Page as the text of an HTML file, with a block that records its origin.
    pub fn html(&self, origin: &Origin) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    h1 { (self.title) }
                    (PreEscaped(&self.body))
                    (origin.block())
                }
            }
        };
        page.into_string()
    }
}
