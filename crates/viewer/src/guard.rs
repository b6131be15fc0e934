//! Who may come in: the token, and the checks that keep other pages in the same browser out.
//!
//! A page from elsewhere can make a browser connect to this machine, by its address or by a name that
//! its owner lets point here. Such a request has a foreign `Origin`, or a foreign name in `Host`.

use std::net::IpAddr;

/// Characters of a token: 128 bits.
const BYTES: usize = 16;

/// A word that cannot be guessed.
///
/// # Errors
/// The system gives no random numbers.
pub(crate) fn token() -> std::io::Result<String> {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes).map_err(std::io::Error::other)?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

/// Whether two words are the same, in a time that does not tell where they differ.
pub(crate) fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b)) == 0
}

/// The names a server answers to.
#[derive(Clone, Debug)]
pub(crate) struct Names {
    /// Whether it is there for other machines: then by every address, and by this name.
    open: Option<String>,
}

impl Names {
    /// Those of this machine alone, from the machine itself or through a tunnel from another.
    pub fn local() -> Self {
        Self { open: None }
    }

    /// Every address, and `name`.
    pub fn open(name: &str) -> Self {
        Self { open: Some(name.into()) }
    }

    /// Whether `host`, as in the header of that name, is one of them. A tunnel may have any port.
    pub fn has(&self, host: &str) -> bool {
        let Some(name) = name_of(host) else { return false };
        let address = name.parse::<IpAddr>().ok();
        let here =
            name.eq_ignore_ascii_case("localhost") || address.is_some_and(|a| a.is_loopback());
        let open = self.open.as_ref();
        here || open.is_some_and(|own| address.is_some() || own.eq_ignore_ascii_case(name))
    }
}

/// The name in `name:port`, without the brackets of an address of version 6.
fn name_of(host: &str) -> Option<&str> {
    let (name, port) = match host.strip_prefix('[') {
        Some(rest) => rest.split_once(']')?,
        None => host.split_at(host.find(':').unwrap_or(host.len())),
    };
    let fits = port.is_empty() || port.strip_prefix(':')?.parse::<u16>().is_ok();
    fits.then_some(name)
}

/// Whether a page of `origin` is one of `host`'s. Without an origin it is no page.
pub(crate) fn is_own(origin: Option<&str>, host: &str) -> bool {
    let Some(origin) = origin else { return true };
    ["http://", "https://"].iter().any(|scheme| origin.strip_prefix(scheme) == Some(host))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_differ_and_are_compared_whole() {
        let (a, b) = (token().unwrap(), token().unwrap());
        assert_eq!(a.len(), 2 * BYTES);
        assert!(a != b && same(&a, &a.clone()) && !same(&a, &b) && !same(&a, &a[1..]));
        assert!(!same(&a, ""));
    }

    #[test]
    fn only_this_machine_is_at_home() {
        let names = Names::local();
        for host in ["127.0.0.1:80", "localhost:1", "LocalHost", "[::1]:8080", "127.0.0.1"] {
            assert!(names.has(host), "{host}");
        }
        let foreign = [
            "example.org",
            "127.0.0.1.example.org:80",
            "localhost.example.org",
            "10.0.0.1:80",
            "",
            ":80",
            "[::1",
            "[::2]:80",
            "localhost:http",
            "localhost:80:80",
            "user@localhost",
        ];
        for host in foreign {
            assert!(!names.has(host), "{host}");
        }
    }

    #[test]
    fn an_open_server_has_its_name_and_any_address() {
        let names = Names::open("node7");
        assert!(names.has("node7:80") && names.has("10.0.0.1:80") && names.has("localhost"));
        assert!(!names.has("example.org:80"));
    }

    #[test]
    fn pages_from_elsewhere_are_told_by_their_origin() {
        let host = "localhost:8080";
        assert!(is_own(None, host) && is_own(Some("http://localhost:8080"), host));
        for foreign in ["http://localhost", "http://localhost:80800", "null", "", "file://"] {
            assert!(!is_own(Some(foreign), host), "{foreign}");
        }
        assert!(!is_own(Some("http://example.org"), host));
    }
}
