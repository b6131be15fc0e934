//! The page: the files of `page/`, in the program.

use std::borrow::Cow;
use std::sync::LazyLock;

/// A file of the page.
pub(crate) struct Asset {
    /// Its name in the folder.
    pub name: &'static str,
    pub bytes: Cow<'static, [u8]>,
}

macro_rules! assets {
    ($($name:literal,)*) => {
        &[$(Asset { name: $name, bytes: Cow::Borrowed(include_bytes!(concat!("../page/", $name))) },)*]
    };
}

/// All of them; a test compares this list with the folder.
const ASSETS: &[Asset] = assets![
    "address.js",
    "camera.js",
    "card.js",
    "colormap.js",
    "connection.js",
    "controls.css",
    "dock.js",
    "dom.js",
    "editors.js",
    "field.js",
    "format.js",
    "gestures.js",
    "help.js",
    "histogram.js",
    "hover.js",
    "icon.svg",
    "icons.js",
    "index.html",
    "keys.js",
    "layout.css",
    "main.js",
    "messages.js",
    "overlay.js",
    "panel-all.js",
    "panel-ask.js",
    "panel-cut.js",
    "panel-filter.js",
    "panel-light.js",
    "panel-log.js",
    "panel-look.js",
    "panel-picture.js",
    "panel-types.js",
    "panel.js",
    "panels.css",
    "paths.js",
    "save.js",
    "sections.js",
    "stage.css",
    "stage.js",
    "store.js",
    "theme.js",
    "timeline.js",
    "tokens.css",
    "toolbar.js",
    "tools.js",
    "types.js",
    "vector.js",
    "where.js",
];

const INDEX: &str = "index.html";

/// The page itself. It names all its modules, so that the browser does not learn of one from another's import.
static PAGE: LazyLock<Asset> = LazyLock::new(|| {
    let written = ASSETS.iter().find(|asset| asset.name == INDEX).map_or(&b""[..], |a| &a.bytes);
    let written = String::from_utf8_lossy(written);
    let modules = ASSETS.iter().filter(|asset| asset.name.ends_with(".js"));
    let links: String = modules
        .map(|asset| format!("<link rel=\"modulepreload\" href=\"/page/{}\">\n", asset.name))
        .collect();
    let whole = written.replacen("<script", &(links + "<script"), 1);
    Asset { name: INDEX, bytes: whole.into_bytes().into() }
});

/// The file called `name`.
pub(crate) fn asset(name: &str) -> Option<&'static Asset> {
    if name == INDEX {
        return Some(&PAGE);
    }
    ASSETS.iter().find(|asset| asset.name == name)
}

impl Asset {
    /// Its media type.
    pub fn media(&self) -> &'static str {
        match self.name.rsplit_once('.').map_or("", |(_, end)| end) {
            "html" => "text/html; charset=utf-8",
            "js" | "mjs" => "text/javascript; charset=utf-8",
            "css" => "text/css; charset=utf-8",
            "svg" => "image/svg+xml",
            "json" | "webmanifest" => "application/json",
            "png" => "image/png",
            _ => "application/octet-stream",
        }
    }

    /// A word that changes with its content.
    pub fn version(&self) -> String {
        // Fowler, Noll & Vo's hash, 64 bits.
        let of = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        format!("\"{:016x}\"", self.bytes.iter().fold(0xcbf2_9ce4_8422_2325, of))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_is_the_folder() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/page");
        let mut there: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        there.sort();
        let mut listed: Vec<_> = ASSETS.iter().map(|asset| asset.name.to_owned()).collect();
        listed.sort();
        assert_eq!(listed, there);
    }

    #[test]
    fn files_have_types_and_versions() {
        let index = asset("index.html").unwrap();
        assert!(index.media().starts_with("text/html"));
        assert_eq!(index.version(), index.version());
        let other = Asset { name: "a", bytes: b"a"[..].into() };
        assert_ne!(index.version(), other.version());
        let page = String::from_utf8_lossy(&index.bytes);
        assert!(page.contains("modulepreload\" href=\"/page/store.js\""));
        assert!(ASSETS.iter().all(|a| a.media() != "application/octet-stream"));
    }
}
