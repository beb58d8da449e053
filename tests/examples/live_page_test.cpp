// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/live_page.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>

#include <doctest/doctest.h>

#include "support/browser.hpp"
#include "support/folder.hpp"
#include "support/http.hpp"
#include "support/report.hpp"

namespace live_page_test {
namespace {

using namespace std::chrono_literals;
using cairn_test::http_get;
using cairn_test::HttpAnswer;
using cairn_test::message_of;

bool can_serve() {
  if (const auto why = example::why_no_live_page()) {
    MESSAGE("skipped: " << *why);
    return false;
  }
  return true;
}

std::uint16_t port_of(const example::LivePage& live) {
  const std::string address = live.address();
  const std::size_t colon = address.rfind(':');
  return static_cast<std::uint16_t>(std::stoi(address.substr(colon + 1)));
}

example::Report titled(const std::string& title) {
  return {title, "a run"};
}

}  // namespace

TEST_SUITE_BEGIN("examples/live page");

TEST_CASE("live page: each page shown is what a reader gets, and it knows its number") {
  if (!can_serve()) return;
  example::LivePage live(0);
  const std::uint16_t port = port_of(live);
  CHECK_FALSE(live.wanted());
  const HttpAnswer before = http_get(port, "/");
  CHECK(before.code == 200);
  CHECK(before.body.find("Nothing to show yet") != std::string::npos);
  CHECK(live.wanted());
  live.show(titled("first"));
  CHECK_FALSE(live.wanted());  // nobody has asked since
  CHECK(http_get(port, "/version").body == "1");
  CHECK_FALSE(live.wanted(1h));  // too soon after the last
  CHECK(live.wanted(0ms));
  CHECK(http_get(port, "/").body.find("<title>first") != std::string::npos);
  CHECK(http_get(port, "/").body.find("\"live\":1") != std::string::npos);
  live.show(titled("second"));
  CHECK(http_get(port, "/version").body == "2");
  CHECK(http_get(port, "/").body.find("<title>second") != std::string::npos);
}

TEST_CASE("live page: the last page asks for no other, and waits for those who look, but not for ever") {
  if (!can_serve()) return;
  example::LivePage live(0);
  const std::uint16_t port = port_of(live);
  const auto seconds = [&](const std::string& title) {
    const auto begin = std::chrono::steady_clock::now();
    live.finish(titled(title).html().value(), 500ms);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  CHECK(seconds("nobody looks") < 0.4);
  CHECK(http_get(port, "/").body.find("\"live\":") == std::string::npos);
  CHECK(seconds("somebody looked and left") >= 0.4);
  http_get(port, "/version");
  std::jthread reader([&] {
    while (http_get(port, "/version").body != "3") std::this_thread::sleep_for(5ms);
    http_get(port, "/");
  });
  CHECK(seconds("somebody waits") < 0.45);
}

TEST_CASE("live page: a browser that looks gets the next page by itself") {
  if (!can_serve()) return;
  if (!cairn_test::has_chromium()) {
    MESSAGE("skipped: no chromium");
    return;
  }
  example::LivePage live(0);
  live.show(titled("under way"));
  std::jthread run([&](const std::stop_token& stop) {
    while (!stop.stop_requested() && !live.wanted(0ms)) std::this_thread::sleep_for(5ms);
    live.finish(titled("done").html().value());
  });
  const cairn_test::Folder folder;
  const cairn_test::OpenedPage opened = cairn_test::open_address(folder, live.address());
  CHECK(opened.console == "");
  CHECK(opened.has("<h1>done"));
  CHECK_FALSE(opened.has("class=\"live\""));
}

TEST_CASE("live page: other paths, methods and names of the host are refused, a taken port is said") {
  if (!can_serve()) return;
  const example::LivePage live(0);
  const std::uint16_t port = port_of(live);
  CHECK(http_get(port, "/etc/passwd").code == 404);
  CHECK(http_get(port, "/../version").code == 404);
  CHECK(cairn_test::http(port, "POST / HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) +
                                   "\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
            .code == 405);
  CHECK(cairn_test::http(port, "GET / HTTP/1.1\r\nHost: rebound.example\r\nConnection: close\r\n\r\n").code ==
        403);
  const std::string taken = message_of([&] { const example::LivePage second(port); });
  CHECK(taken.find("port " + std::to_string(port)) != std::string::npos);
}

TEST_SUITE_END();

}  // namespace live_page_test
