//! Files over REST as HTTP has them: entity tags, conditions and ranges (RFC 9110). Knows no table.

use super::error::Problem;
use crate::archive::gathered::Gathered;
use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use headers::{ContentRange, ETag, HeaderMapExt, IfMatch, IfNoneMatch, IfRange};
use http_range_header::parse_range_header;
use std::future::Future;
use std::ops::Range;
use std::sync::Arc;
use utoipa::IntoParams;

/// Bytes read at once: each reading is a turn of another thread.
const AT_ONCE: usize = 1 << 18;

/// Headers of a request that choose what of a file is sent.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Header)]
#[allow(dead_code, reason = "describes the headers; `answer` reads them")]
pub struct Conditions {
    /// Bytes that are wanted, such as `bytes=0-1023` or `bytes=-8`: one range; several are answered by the whole
    /// file.
    #[param(rename = "Range")]
    range: Option<String>,
    /// A tag: the range is answered by the whole file if it is another file now.
    #[param(rename = "If-Range")]
    if_range: Option<String>,
    /// Tags of files that the client has.
    #[param(rename = "If-None-Match")]
    if_none_match: Option<String>,
    /// Tags of files of which one must still be it.
    #[param(rename = "If-Match")]
    if_match: Option<String>,
}

/// A file that may be downloaded.
#[derive(Debug, Clone)]
pub struct Offer {
    /// Stands for its bytes: changes whenever they do.
    pub mark: String,
    /// Media type.
    pub content_type: &'static str,
    /// Name for whoever saves it.
    pub name: String,
}

/// Answers a request for a file, which is made only if its bytes or its length are asked for.
pub async fn answer<E: From<Problem>>(
    method: &Method,
    asked: &HeaderMap,
    offer: &Offer,
    file: impl Future<Output = Result<Arc<Gathered>, E>>,
) -> Result<Response, E> {
    let tag: ETag = format!("\"{}\"", offer.mark).parse().map_err(|_| Problem::untold())?;
    if asked.typed_get::<IfMatch>().is_some_and(|wanted| !wanted.precondition_passes(&tag)) {
        return Err(Problem::changed().into());
    }
    let mut told = HeaderMap::new();
    told.typed_insert(tag.clone());
    told.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    // What is compressed on its way is another representation, see `weaken`.
    told.insert(header::VARY, HeaderValue::from_name(header::ACCEPT_ENCODING));
    let known = asked.typed_get::<IfNoneMatch>();
    if known.is_some_and(|known| !known.precondition_passes(&tag)) {
        return Ok((StatusCode::NOT_MODIFIED, told).into_response());
    }
    let file = file.await?;
    let length = file.length();
    // A date never holds: these files have none.
    let is_current = !asked.contains_key(header::IF_RANGE)
        || asked.typed_get::<IfRange>().is_some_and(|had| !had.is_modified(Some(&tag), None));
    let is_asked = *method == Method::GET && is_current;
    let wanted = match asked.get(header::RANGE).filter(|_| is_asked) {
        Some(range) => wanted(range, length),
        None => Wanted::All,
    };
    let (status, bytes) = match wanted {
        Wanted::All => (StatusCode::OK, 0..length),
        Wanted::Some(bytes) => {
            let range = ContentRange::bytes(bytes.clone(), length);
            told.typed_insert(range.map_err(|_| Problem::untold())?);
            (StatusCode::PARTIAL_CONTENT, bytes)
        }
        Wanted::Nothing => {
            let problem = Problem::unsatisfiable(length).into_response();
            told.typed_insert(ContentRange::unsatisfied_bytes(length));
            return Ok((told, problem).into_response());
        }
    };
    told.insert(header::CONTENT_TYPE, HeaderValue::from_static(offer.content_type));
    let disposition = format!("attachment; filename=\"{}\"", offer.name);
    let disposition = HeaderValue::from_str(&disposition).map_err(|_| Problem::untold())?;
    told.insert(header::CONTENT_DISPOSITION, disposition);
    told.insert(header::CONTENT_LENGTH, (bytes.end - bytes.start).into());
    Ok((status, told, body(file, bytes)).into_response())
}

/// Makes the tag of an answer that was compressed a weak one: the bytes that it stands for are others.
pub async fn weaken(mut response: Response) -> Response {
    let is_encoded = response.headers().contains_key(header::CONTENT_ENCODING);
    if let Some(tag) = response.headers().get(header::ETAG).filter(|_| is_encoded)
        && let Ok(tag) = tag.to_str()
        && !tag.starts_with("W/")
        && let Ok(weak) = HeaderValue::from_str(&format!("W/{tag}"))
    {
        response.headers_mut().insert(header::ETAG, weak);
    }
    response
}

#[derive(Debug, PartialEq)]
enum Wanted {
    All,
    Some(Range<u64>),
    Nothing,
}

/// The bytes that a `Range` asks for; all where it is not understood or asks for several stretches.
fn wanted(range: &HeaderValue, length: u64) -> Wanted {
    let one = range.to_str().ok().filter(|range| !range.contains(','));
    let Some(parsed) = one.and_then(|range| parse_range_header(range).ok()) else {
        return Wanted::All;
    };
    match parsed.validate(length).as_deref() {
        Ok([bytes]) => Wanted::Some(*bytes.start()..bytes.end() + 1),
        Ok(_) => Wanted::All,
        Err(_) => Wanted::Nothing,
    }
}

fn body(file: Arc<Gathered>, bytes: Range<u64>) -> Body {
    Body::from_stream(stream::try_unfold(bytes.start, move |from| {
        let (file, end) = (file.clone(), bytes.end);
        async move {
            let most = usize::try_from(end - from).unwrap_or(usize::MAX).min(AT_ONCE);
            if most == 0 {
                return Ok(None);
            }
            let read = tokio::task::spawn_blocking(move || file.read_at(from, most));
            let read = read.await.map_err(std::io::Error::other)??;
            let next = from + read.len() as u64;
            Ok::<_, std::io::Error>(Some((read, next)))
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(range: &'static str, length: u64) -> Wanted {
        wanted(&HeaderValue::from_static(range), length)
    }

    #[test]
    fn ranges_are_read_as_the_standard_has_them() {
        assert_eq!(of("bytes=0-3", 10), Wanted::Some(0..4));
        assert_eq!(of("bytes=8-100", 10), Wanted::Some(8..10));
        assert_eq!(of("bytes=4-", 10), Wanted::Some(4..10));
        assert_eq!(of("bytes=-4", 10), Wanted::Some(6..10));
        assert_eq!(of("bytes=-40", 10), Wanted::Some(0..10));
        for unsatisfiable in ["bytes=10-", "bytes=10-12", "bytes=-0"] {
            assert_eq!(of(unsatisfiable, 10), Wanted::Nothing, "{unsatisfiable}");
        }
        assert_eq!(of("bytes=0-3", 0), Wanted::Nothing);
        for not_understood in ["bytes=3-0", "bytes=a-b", "lines=0-3", "bytes=0-1,4-5", "bytes"] {
            assert_eq!(of(not_understood, 10), Wanted::All, "{not_understood}");
        }
    }
}
