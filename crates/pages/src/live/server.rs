//! A small server for one reader on the same machine: HTTP/1.1, GET alone, on the loopback address, read-only.
//!
//! Whoever names another host is refused: a page from elsewhere cannot make a browser read from here under a name of its own. What is
//! asked must come within seconds and be short, and only a few are heard at a time. Nothing that goes wrong here reaches anybody else.

use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant, SystemTime};

use scrnn_run::failure::Failure;

/// Bytes of the longest request.
const LONGEST: usize = 8 << 10;
/// A request that has not come by then is no request.
const PATIENCE: Duration = Duration::from_secs(5);
/// Requests that are heard at a time.
const MOST: usize = 8;
/// How often an idle server looks whether it should end.
const NAP: Duration = Duration::from_millis(50);

/// What is served at a path: its type and its bytes; none for what is not there.
pub type Answer = dyn Fn(&str) -> Option<(&'static str, Vec<u8>)> + Send + Sync;

/// A server in threads of its own. It ends when it is dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    ended: Arc<AtomicBool>,
}

impl Server {
    /// Serves on the loopback address; port 0 is any that is free.
    ///
    /// # Errors
    /// What the operating system says, e.g. of a port that is taken.
    pub fn start(port: u16, answer: Box<Answer>) -> std::io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let ended = Arc::new(AtomicBool::new(false));
        let (answer, over): (Arc<Answer>, _) = (answer.into(), Arc::clone(&ended));
        let busy = Arc::new(AtomicUsize::new(0));
        std::thread::Builder::new().name("watch".into()).spawn(move || {
            while !over.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((stream, _)) if busy.fetch_add(1, Ordering::SeqCst) < MOST => {
                        let (answer, free) = (Arc::clone(&answer), Free(Arc::clone(&busy)));
                        let heard = move || {
                            let _free = free;
                            // A reader that went away is nobody's trouble.
                            let _ = serve(stream, address.port(), &*answer);
                        };
                        let _ = std::thread::Builder::new().name("reader".into()).spawn(heard);
                    }
                    Ok((_, _)) => {
                        busy.fetch_sub(1, Ordering::SeqCst);
                    }
                    Err(_) => std::thread::sleep(NAP),
                }
            }
        })?;
        Ok(Self { address, ended })
    }

    /// Where it is read.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}/", self.address)
    }
}

/// Another for each page of each run of the program: who finds another begins anew.
pub(super) fn this_run() -> String {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    format!("{}-{}", std::process::id(), since.as_nanos())
}

/// Serves on the loopback address.
pub(super) fn served(port: u16, answer: Box<Answer>) -> Result<Server, Failure> {
    Server::start(port, answer).map_err(|error| {
        Failure::input(
            format!("nothing can be served on port {port}: {error}"),
            "give another, or 0 for any that is free",
        )
    })
}

impl Drop for Server {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
    }
}

/// A reader that counts until it is dropped, also by a panic.
struct Free(Arc<AtomicUsize>);

impl Drop for Free {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

fn serve(mut stream: TcpStream, port: u16, answer: &Answer) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let request = request(&mut stream)?;
    let (status, kind, body) = match judged(&request, port) {
        Ok(path) => match answer(path) {
            Some((kind, body)) => ("200 OK", kind, body),
            None => ("404 Not Found", "text/plain", b"not found\n".to_vec()),
        },
        Err(status) => (status, "text/plain", format!("{status}\n").into_bytes()),
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {}\r\nConnection: close\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\nReferrer-Policy: no-referrer\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(&body)
}

/// The head of a request, up to the empty line; what came, if it is too long or comes too late.
fn request(stream: &mut TcpStream) -> std::io::Result<Vec<u8>> {
    let (begun, mut head) = (Instant::now(), Vec::new());
    let mut bytes = [0; 1024];
    while !ends(&head) && head.len() < LONGEST {
        let Some(left) = PATIENCE.checked_sub(begun.elapsed()).filter(|left| !left.is_zero()) else { break };
        stream.set_read_timeout(Some(left))?;
        match stream.read(&mut bytes)? {
            0 => break,
            count => head.extend_from_slice(&bytes[..count]),
        }
    }
    Ok(head)
}

fn ends(head: &[u8]) -> bool {
    head.windows(4).any(|four| four == b"\r\n\r\n")
}

/// The path that is asked for, or why there is no answer.
fn judged(head: &[u8], port: u16) -> Result<&str, &'static str> {
    const BAD: &str = "400 Bad Request";
    if !ends(head) {
        return Err(if head.len() >= LONGEST { "431 Request Header Fields Too Large" } else { BAD });
    }
    let text = std::str::from_utf8(head).map_err(|_| BAD)?;
    let mut lines = text.split("\r\n");
    let mut first = lines.next().unwrap_or_default().split(' ');
    let (method, target, version) = (first.next(), first.next(), first.next());
    let (Some(method), Some(target), Some("HTTP/1.1" | "HTTP/1.0"), None) = (method, target, version, first.next())
    else {
        return Err(BAD);
    };
    let hosts: Vec<&str> = lines
        .filter_map(|line| line.split_once(':'))
        .filter(|(name, _)| name.eq_ignore_ascii_case("host"))
        .map(|(_, value)| value.trim())
        .collect();
    let known = |host: &str| {
        ["127.0.0.1", "localhost", "[::1]"].iter().any(|name| {
            host.strip_prefix(name)
                .is_some_and(|rest| rest.strip_prefix(':').and_then(|rest| rest.parse().ok()) == Some(port))
        })
    };
    match hosts[..] {
        [host] if known(&host.to_ascii_lowercase()) => {}
        _ => return Err("403 Forbidden"),
    }
    if method != "GET" {
        return Err("405 Method Not Allowed");
    }
    if target.starts_with('/') { Ok(target.split('?').next().unwrap_or(target)) } else { Err(BAD) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_hosts_other_methods_and_what_is_no_request_are_refused() {
        let judge = |text: &str| judged(text.as_bytes(), 80).map(str::to_owned);
        assert_eq!(judge("GET /a?b=1 HTTP/1.1\r\nHost: localhost:80\r\n\r\n"), Ok("/a".into()));
        for (text, status) in [
            ("GET / HTTP/1.1\r\nHost: evil.example:80\r\n\r\n", "403 Forbidden"),
            ("GET / HTTP/1.1\r\nHost: localhost:81\r\n\r\n", "403 Forbidden"),
            ("GET / HTTP/1.1\r\nHost: localhost:80.evil.example\r\n\r\n", "403 Forbidden"),
            ("GET / HTTP/1.1\r\nHost: localhost:80\r\nHost: localhost:80\r\n\r\n", "403 Forbidden"),
            ("GET / HTTP/1.1\r\n\r\n", "403 Forbidden"),
            ("POST / HTTP/1.1\r\nHost: localhost:80\r\n\r\n", "405 Method Not Allowed"),
            ("GET http://localhost/ HTTP/1.1\r\nHost: localhost:80\r\n\r\n", "400 Bad Request"),
            ("GET /\r\nHost: localhost:80\r\n\r\n", "400 Bad Request"),
            ("GET / HTTP/1.1\r\nHost: localhost:80\r\n", "400 Bad Request"),
        ] {
            assert_eq!(judge(text), Err(status), "{text}");
        }
        assert_eq!(judged(&vec![b'a'; LONGEST], 80), Err("431 Request Header Fields Too Large"));
    }

    fn asked(server: &Server, text: &[u8]) -> String {
        let mut stream = TcpStream::connect(server.address).unwrap();
        stream.write_all(text).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn it_answers_on_the_loopback_address_alone_and_ends_with_its_owner() {
        let server =
            Server::start(0, Box::new(|path| (path == "/").then(|| ("text/plain", b"hello".to_vec())))).unwrap();
        assert!(server.address.ip().is_loopback());
        let host = format!("Host: {}\r\n\r\n", server.address);
        let page = asked(&server, format!("GET / HTTP/1.1\r\n{host}").as_bytes());
        assert!(page.starts_with("HTTP/1.1 200 OK\r\n") && page.ends_with("\r\n\r\nhello"), "{page}");
        assert!(asked(&server, format!("GET /x HTTP/1.1\r\n{host}").as_bytes()).starts_with("HTTP/1.1 404"));
        // Somebody who says nothing takes no place from others.
        let _idle: Vec<TcpStream> = (0..3).map(|_| TcpStream::connect(server.address).unwrap()).collect();
        assert!(asked(&server, format!("GET / HTTP/1.1\r\n{host}").as_bytes()).ends_with("hello"));
        assert!(Server::start(server.address.port(), Box::new(|_| None)).is_err(), "the port is taken");
        let address = server.address;
        drop(server);
        std::thread::sleep(4 * NAP);
        let gone = TcpStream::connect_timeout(&address, PATIENCE).is_err();
        assert!(gone, "nobody listens any more");
    }
}
