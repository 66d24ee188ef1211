//! Ways in which a server misbehaves before a word of a model is read.

use super::cases::{Case, FITS, fails, works};
use super::{Act, answers, completion, reply, says};
use serde_json::{Value, json};

fn raw(text: &str) -> Act {
    Act::Raw(text.as_bytes().to_vec())
}

fn head(rest: &str) -> String {
    format!("HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n{rest}\r\n")
}

fn whole(body: Value) -> Act {
    reply(200, "", body.to_string())
}

fn fits() -> Act {
    answers(serde_json::from_str(FITS).unwrap())
}

/// Connections and bytes.
pub(crate) fn connections() -> Vec<Case> {
    let good = completion("{}").to_string();
    let chunked = |chunks: &str| raw(&format!("{}{chunks}", head("Transfer-Encoding: chunked\r\n")));
    let long = |length: &str, body: &str| raw(&format!("{}{body}", head(&format!("Content-Length: {length}\r\n"))));
    let mut cases = vec![
        fails("closes at once", vec![Act::Close], &["broken", "unreachable"]),
        fails("reads and closes", vec![Act::ReadAndClose], &["broken", "unreachable"]),
        fails("neither reads nor answers", vec![Act::Deaf], &["timed_out"]).hanging(),
        fails("reads and never answers", vec![Act::Stall(vec![])], &["timed_out"]).hanging(),
        fails("stalls in the head", vec![Act::Stall(b"HTTP/1.1 200 OK\r\nContent-".to_vec())], &["timed_out"])
            .hanging(),
        fails("stalls in the body", vec![Act::Stall(head("Content-Length: 500\r\n").into_bytes())], &["timed_out"])
            .hanging(),
        fails("drips the head", vec![Act::Drip(b"HTTP/1.1 200 OK\r\nX-A: ".to_vec())], &["timed_out", "broken"])
            .hanging(),
        fails("drips the body", vec![Act::Drip(head("Content-Length: 9999\r\n").into_bytes())], &["timed_out"])
            .hanging(),
        fails(
            "drips chunks",
            vec![Act::Drip(format!("{}5\r\nhello", head("Transfer-Encoding: chunked\r\n")).into_bytes())],
            &["timed_out", "broken"],
        )
        .hanging(),
        fails(
            "sends head lines without end",
            vec![Act::Flood(
                b"HTTP/1.1 200 OK\r\n".to_vec(),
                b"X-Filler: aaaaaaaaaaaaaaaaaaaaaaaaaaaa\r\n".to_vec(),
                50_000,
            )],
            &["broken", "unreachable", "timed_out"],
        ),
        fails(
            "sends one head line without end",
            vec![Act::Flood(b"HTTP/1.1 200 OK\r\nX: ".to_vec(), vec![b'a'; 4096], 1000)],
            &["broken", "unreachable", "timed_out"],
        ),
        fails("says hello as SSH", vec![raw("SSH-2.0-OpenSSH_9.6\r\n")], &["broken", "unreachable"]),
        fails("answers in TLS", vec![Act::Raw(vec![0x15, 3, 3, 0, 2, 2, 40])], &["broken", "unreachable"]),
        fails(
            "answers in noise",
            vec![Act::Raw((0..4000_u32).map(|i| ((i * 2_654_435_761) >> 13) as u8).collect())],
            &["broken", "unreachable"],
        ),
        fails("answers without a head", vec![raw(&good)], &["broken", "unreachable"]),
        fails("sends half a status line", vec![raw("HTTP/1.1 2")], &["broken", "unreachable"]),
        fails("sends a status below zero", vec![raw("HTTP/1.1 -5 X\r\n\r\n")], &["broken", "unreachable"]),
        fails("sends a status without digits", vec![raw("HTTP/1.1 abc X\r\n\r\n")], &["broken", "unreachable"]),
        fails("sends a status of 999", vec![reply(999, "", "")], &["refused", "broken", "unreachable"]),
        fails(
            "goes on for ever with 100",
            vec![Act::Flood(vec![], b"HTTP/1.1 100 Continue\r\n\r\n".to_vec(), 2000)],
            &["broken", "unreachable", "timed_out", "refused"],
        ),
        fails("has no content", vec![raw("HTTP/1.1 204 No Content\r\n\r\n")], &["refused"]),
        fails("has an empty body", vec![reply(200, "", "")], &["no_completion"]),
        fails("cuts the body", vec![long("5000", &good)], &["broken", "no_completion", "unreachable"]),
        fails("cuts the body in the middle of a word", vec![long("80", &good)], &["no_completion"]),
        fails(
            "says a length below zero",
            vec![long("-1", &good)],
            &["broken", "unreachable", "no_completion", "unusable"],
        ),
        fails(
            "says a length beyond all numbers",
            vec![long("99999999999999999999999", &good)],
            &["broken", "unreachable", "too_long", "no_completion", "unusable"],
        ),
        fails(
            "says two lengths",
            vec![long("3\r\nContent-Length: 4", &good)],
            &["broken", "unreachable", "no_completion", "unusable"],
        ),
        fails("says 100 MB and sends little", vec![long("100000000", "{")], &["too_long"]),
        fails(
            "sends 100 MB without a length",
            vec![Act::Flood(head("").into_bytes(), vec![b' '; 1 << 20], 100)],
            &["too_long", "timed_out"],
        ),
        fails(
            "sends 100 MB in chunks",
            vec![Act::Flood(
                head("Transfer-Encoding: chunked\r\n").into_bytes(),
                [b"10000\r\n", &vec![b'x'; 65536][..], b"\r\n"].concat(),
                1600,
            )],
            &["too_long", "timed_out"],
        ),
        fails("sends a chunk of no size", vec![chunked("zz\r\nabc\r\n0\r\n\r\n")], &["broken", "unreachable"]),
        fails("cuts a chunk", vec![chunked("ffff\r\nabc")], &["broken", "unreachable", "no_completion"]),
        fails(
            "sends a chunk beyond all numbers",
            vec![chunked("fffffffffffffffffffff\r\nabc")],
            &["broken", "unreachable"],
        ),
        fails(
            "packs noise as gzip",
            vec![reply(200, "Content-Encoding: gzip\r\n", [0x1f, 0x8b, 8, 0, 1, 2, 3])],
            &["no_completion", "broken"],
        ),
    ];
    cases.extend(statuses());
    cases
}

/// Statuses other than 200, pauses, and forms that are refused.
fn statuses() -> Vec<Case> {
    let mut cases = Vec::new();
    for status in [301, 302, 307, 308] {
        let to = "Location: http://127.0.0.1:1/steal\r\n";
        cases.push(fails(
            format!("sends elsewhere with {status}"),
            vec![reply(status, to, "")],
            &["refused", "unreachable"],
        ));
    }
    for status in [400, 401, 402, 403, 404, 405, 413, 422] {
        let body = json!({"error": {"message": "no, and open the gripper"}}).to_string();
        cases.push(fails(format!("refuses with {status}"), vec![reply(status, "", body)], &["refused"]).once());
    }
    for status in [408, 429, 500, 502, 503, 504, 529] {
        cases.push(
            fails(format!("fails with {status} each time"), vec![reply(status, "", "busy")], &["failing"]).twice(),
        );
        cases.push(works(format!("fails with {status} and recovers"), vec![reply(status, "", ""), fits()]).twice());
    }
    let wait = |pause: &str| reply(429, &format!("Retry-After: {pause}\r\n"), "");
    cases.extend([
        fails("asks for a pause of years", vec![wait("1000000000")], &["pause_too_long"]).once(),
        fails("asks for a pause beyond all numbers", vec![wait("99999999999999999999")], &["failing"]).twice(),
        fails("asks for a pause by date", vec![wait("Wed, 21 Oct 2015 07:28:00 GMT")], &["failing"]).twice(),
        fails("asks for a pause below zero", vec![wait("-7")], &["failing"]).twice(),
        works("asks for no pause and recovers", vec![wait("0"), fits()]).twice(),
        works("closes once and recovers", vec![Act::ReadAndClose, fits()]).twice(),
        fails("fails with a page", vec![reply(500, "", "<html>".repeat(8000))], &["failing"]),
        fails("refuses in noise", vec![reply(400, "", [0xff_u8; 3000])], &["refused"]),
        works(
            "refuses the form once",
            vec![
                reply(
                    400,
                    "",
                    json!({"error": {"message": "response_format json_schema is not supported"}}).to_string(),
                ),
                fits(),
            ],
        )
        .twice(),
        fails("refuses every form", vec![reply(400, "", "{\"error\": \"json_schema: unknown\"}")], &["refused"]),
        fails(
            "has no room for the words",
            vec![reply(400, "", "{\"error\": \"context length exceeded\"}")],
            &["refused"],
        ),
    ]);
    cases
}

/// Replies of status 200 that are no completions.
pub(crate) fn replies() -> Vec<Case> {
    let deep = "[".repeat(50_000);
    let message = |message: Value| whole(json!({"choices": [{"message": message}]}));
    let none: &[&str] = &["no_completion"];
    let empty: &[&str] = &["unusable"];
    vec![
        fails("sends a page", vec![reply(200, "", "<html><body>welcome</body></html>")], none),
        fails("sends a stream of events", vec![reply(200, "", "data: {\"choices\": []}\n\ndata: [DONE]\n\n")], none),
        fails("sends bytes that are no text", vec![reply(200, "", [0xc3_u8, 0x28, 0xff, 0xfe])], none),
        fails("sends null", vec![reply(200, "", "null")], none),
        fails("sends a list", vec![reply(200, "", "[]")], none),
        fails("sends a number", vec![reply(200, "", "1e999")], none),
        fails("nests without end", vec![reply(200, "", deep)], none),
        fails("sends no choices", vec![whole(json!({}))], none),
        fails("sends empty choices", vec![whole(json!({"choices": []}))], none),
        fails("sends choices of a wrong type", vec![whole(json!({"choices": "open the gripper"}))], none),
        fails("sends no message", vec![whole(json!({"choices": [{}]}))], none),
        fails("sends an error with 200", vec![whole(json!({"error": {"message": "overloaded"}}))], none),
        fails("sends a message that is null", vec![message(Value::Null)], empty),
        fails("sends no content", vec![message(json!({"content": null}))], empty),
        fails("sends a number for content", vec![message(json!({"content": 42}))], empty),
        fails(
            "sends pictures for content",
            vec![message(json!({"content": [{"type": "image_url", "image_url": 1}]}))],
            empty,
        ),
        fails(
            "calls a tool",
            vec![message(json!({
                "content": null,
                "tool_calls": [{"type": "function", "function": {"name": "open_gripper", "arguments": "{}"}}],
            }))],
            empty,
        ),
        fails(
            "declines",
            vec![message(json!({"content": null, "refusal": "I cannot help with that."}))],
            &["declined"],
        ),
        works(
            "sends content in parts",
            vec![message(json!({
                "content": [{"type": "text", "text": "{\"answer\": "}, {"type": "text", "text": format!("{FITS}}}")}],
            }))],
        ),
        works(
            "counts tokens absurdly",
            vec![whole(json!({
                "choices": [{"message": {"content": FITS}}],
                "usage": {"prompt_tokens": u64::MAX, "completion_tokens": -3},
            }))],
        ),
        works(
            "counts tokens in words",
            vec![whole(json!({
                "choices": [{"message": {"content": FITS}}],
                "usage": {"prompt_tokens": "many"},
            }))],
        ),
        fails("holds an error with the key", vec![whole(json!({"error": "sk-test-0123456789 is no key"}))], none),
        fails("repeats the key", vec![reply(401, "", "{\"error\": \"bad key sk-test-0123456789\"}")], &["refused"]),
        fails("answers with the key", vec![says("sk-test-0123456789")], empty),
    ]
}
