//! Who may ask: the name the page is asked under, the page that asks, and the token.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::header::{AUTHORIZATION, HOST, ORIGIN};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::address::{Address, Host};
use super::token::Token;

/// Headers of every answer. Nothing is loaded from elsewhere or written into the page as anything but text, nobody frames it,
/// and no other page can read it.
const HEADERS: [(&str, &str); 5] = [
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'; trusted-types 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    ("x-frame-options", "DENY"),
];

/// What is refused, and how to be let in.
type Refusal = (StatusCode, &'static str);

/// Judges requests.
#[derive(Clone, Debug)]
pub(crate) struct Guard {
    is_loopback: bool,
    /// The name that was given as the address, if it was one.
    name: Option<String>,
    token: Option<Token>,
    /// Whose pages may ask, besides this server's own.
    origins: Arc<[String]>,
    /// Whether the token may stand in the address, for programs that can send no header.
    by_address: bool,
}

/// Every request, and every answer.
pub(crate) async fn at_the_door(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    let mut response = match guard.admits(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(refusal) => refusal.into_response(),
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Every request for what is shown or done.
pub(crate) async fn with_token(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    match guard.knows_token(request.headers(), request.uri().query()) {
        Ok(()) => next.run(request).await,
        Err(refusal) => refusal.into_response(),
    }
}

impl Guard {
    /// Of a server that listens there, as asked for by `address`.
    pub fn new(address: &Address, listens: SocketAddr, token: Option<Token>) -> Self {
        let name = match address.host() {
            Host::Name(name) => Some(name.clone()),
            Host::Ip(_) => None,
        };
        let is_loopback = listens.ip().is_loopback();
        Self { is_loopback, name, token, origins: Arc::default(), by_address: false }
    }

    /// Lets in the pages of these origins too, and takes the token from the address as well: `?token=…`.
    pub fn for_viewers(self, origins: Vec<String>) -> Self {
        Self { origins: origins.into(), by_address: true, ..self }
    }

    /// Whether a request comes by a name that can only mean this server, and not from another site's page: such a page can
    /// make a browser ask here, under a name of its own that it points here, or across origins.
    fn admits(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        const NOT_HERE: Refusal = (
            StatusCode::FORBIDDEN,
            "This page is not served under that name: use the address that it was started with.\n",
        );
        const ELSEWHERE: Refusal = (StatusCode::FORBIDDEN, "Another site's page may not ask here.\n");
        let host = one(headers, HOST.as_str()).ok_or(NOT_HERE)?;
        if !self.is_mine(host) {
            return Err(NOT_HERE);
        }
        match headers.get(ORIGIN) {
            None => Ok(()),
            Some(origin) => {
                let origin = origin.to_str().map_err(|_| ELSEWHERE)?;
                let is_own = origin.strip_prefix("http://") == Some(host);
                if is_own || self.origins.iter().any(|it| it == origin) { Ok(()) } else { Err(ELSEWHERE) }
            }
        }
    }

    /// Whether a request for what the page shows or does has the token.
    fn knows_token(&self, headers: &HeaderMap, query: Option<&str>) -> Result<(), Refusal> {
        const UNKNOWN: Refusal = (
            StatusCode::UNAUTHORIZED,
            "A token is needed: open the address that was printed at the start, or send `Authorization: Bearer TOKEN`.\n",
        );
        let Some(token) = &self.token else { return Ok(()) };
        let bearer = one(headers, AUTHORIZATION.as_str()).and_then(|given| given.strip_prefix("Bearer "));
        let mut pairs = query.filter(|_| self.by_address).unwrap_or_default().split('&');
        let given = bearer.or_else(|| pairs.find_map(|pair| pair.strip_prefix("token=")));
        if given.is_some_and(|given| token.is(given)) { Ok(()) } else { Err(UNKNOWN) }
    }

    /// An IP address cannot be pointed elsewhere; a name can, unless it is one that was chosen for this page.
    fn is_mine(&self, host: &str) -> bool {
        let host = match host.rsplit_once(':') {
            Some((name, port)) if port.bytes().all(|b| b.is_ascii_digit()) => name,
            _ => host,
        };
        let host = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
        match Host::read(host) {
            Some(Host::Ip(ip)) => !self.is_loopback || is_loopback(ip),
            Some(Host::Name(name)) => name == "localhost" || self.name.as_ref() == Some(&name),
            None => false,
        }
    }
}

fn is_loopback(ip: IpAddr) -> bool {
    ip.to_canonical().is_loopback()
}

/// A header that is there once.
fn one<'h>(headers: &'h HeaderMap, name: &str) -> Option<&'h str> {
    let mut all = headers.get_all(name).iter();
    let first: &HeaderValue = all.next()?;
    if all.next().is_some() { None } else { first.to_str().ok() }
}
