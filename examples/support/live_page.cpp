// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "support/live_page.hpp"

#include <utility>

#include <cairn/core/check.hpp>

#ifdef EXAMPLES_HAVE_MICROHTTPD

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <string_view>

#include <arpa/inet.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace example {
namespace {

using Clock = std::chrono::steady_clock;

// Loaded anew by itself until there is a first page.
constexpr std::string_view waiting =
    "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta http-equiv=\"refresh\" "
    "content=\"1\">"
    "<title>waiting</title></head><body><p>Nothing to show yet.</p></body></html>";

MHD_Result answer(MHD_Connection* connection, unsigned code, const char* type, std::string_view text) {
  // The library copies what it is given; it takes a pointer that is not const and writes nothing to it.
  MHD_Response* const response =
      MHD_create_response_from_buffer(text.size(), const_cast<char*>(text.data()), MHD_RESPMEM_MUST_COPY);
  if (response == nullptr) return MHD_NO;
  MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, type);
  MHD_add_response_header(response, MHD_HTTP_HEADER_CACHE_CONTROL, "no-store");
  const MHD_Result queued = MHD_queue_response(connection, code, response);
  MHD_destroy_response(response);
  return queued;
}

}  // namespace

struct LivePage::Server {
  mutable std::mutex mutex;
  std::condition_variable fetched;
  std::string page;
  std::uint64_t version = 0;  // of the page; 0: none yet
  std::uint64_t version_fetched = 0;
  bool asked = false;  // since the page was shown
  Clock::time_point last_asked{}, last_shown{};
  MHD_Daemon* daemon = nullptr;
  std::atomic<std::uint16_t> port = 0;

  static MHD_Result handle(void* self, MHD_Connection* connection, const char* url, const char* method,
                           const char* /*protocol*/, const char* /*upload*/, std::size_t* /*upload_size*/,
                           void** /*of_request*/) noexcept {
    auto& server = *static_cast<Server*>(self);
    if (std::string_view(method) != MHD_HTTP_METHOD_GET)
      return answer(connection, MHD_HTTP_METHOD_NOT_ALLOWED, "text/plain", "only GET");
    // A name that another site resolved to this address must not read the page through its visitor's browser.
    const char* const host = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_HOST);
    const std::string here = std::to_string(server.port);
    if (host == nullptr || (host != "127.0.0.1:" + here && host != "localhost:" + here))
      return answer(connection, MHD_HTTP_FORBIDDEN, "text/plain", "ask for 127.0.0.1");
    const std::string_view path(url);
    const std::lock_guard lock(server.mutex);
    if (path == "/" || path == "/version") {
      server.asked = true;
      server.last_asked = Clock::now();
    }
    if (path == "/version")
      return answer(connection, MHD_HTTP_OK, "text/plain", std::to_string(server.version));
    if (path != "/") return answer(connection, MHD_HTTP_NOT_FOUND, "text/plain", "there is only /");
    if (server.version == 0) return answer(connection, MHD_HTTP_OK, "text/html; charset=utf-8", waiting);
    server.version_fetched = server.version;
    server.fetched.notify_all();
    return answer(connection, MHD_HTTP_OK, "text/html; charset=utf-8", server.page);
  }

  void put(std::string html, std::uint64_t number) {
    const std::lock_guard lock(mutex);
    page = std::move(html);
    version = number;
    asked = false;
    last_shown = Clock::now();
  }
};

LivePage::LivePage(std::uint16_t port) : server_(std::make_unique<Server>()) {
  if (const auto why = why_no_live_page()) cairn::raise(*why);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  server_->daemon = MHD_start_daemon(MHD_USE_AUTO | MHD_USE_INTERNAL_POLLING_THREAD, port, nullptr, nullptr,
                                     &Server::handle, server_.get(), MHD_OPTION_SOCK_ADDR,
                                     reinterpret_cast<const sockaddr*>(&address), MHD_OPTION_END);
  if (server_->daemon == nullptr)
    cairn::raise("no live page: port " + std::to_string(port) +
                 " of 127.0.0.1 cannot be had; 0 takes any that is free");
  const MHD_DaemonInfo* const bound = MHD_get_daemon_info(server_->daemon, MHD_DAEMON_INFO_BIND_PORT);
  server_->port = bound == nullptr ? port : bound->port;
}

LivePage::~LivePage() {
  MHD_stop_daemon(server_->daemon);
}

std::string LivePage::address() const {
  return "http://127.0.0.1:" + std::to_string(server_->port) + "/";
}

bool LivePage::wanted(std::chrono::milliseconds rest) const {
  const std::lock_guard lock(server_->mutex);
  return server_->asked && (server_->version == 0 || Clock::now() - server_->last_shown >= rest);
}

void LivePage::show(Report report) {
  const std::uint64_t number = server_->version + 1;  // only this thread changes it
  report.live(number);
  if (auto html = report.html()) server_->put(std::move(*html), number);
}

void LivePage::finish(std::string html, std::chrono::milliseconds patience) {
  const std::uint64_t number = server_->version + 1;
  const bool watched = [&] {
    const std::lock_guard lock(server_->mutex);
    return server_->last_asked != Clock::time_point{} && Clock::now() - server_->last_asked < patience;
  }();
  server_->put(std::move(html), number);
  if (!watched) return;
  std::unique_lock lock(server_->mutex);
  server_->fetched.wait_for(lock, patience, [&] { return server_->version_fetched == number; });
}

std::optional<std::string> why_no_live_page() {
  if (!has_report_page()) return why_no_report();
  return std::nullopt;
}

}  // namespace example

#else

namespace example {

struct LivePage::Server {};

std::optional<std::string> why_no_live_page() {
  return "this program was built without live pages: libmicrohttpd was not found (Debian: libmicrohttpd-dev)";
}

LivePage::LivePage(std::uint16_t) {
  cairn::raise(*why_no_live_page());
}
LivePage::~LivePage() = default;
std::string LivePage::address() const {
  return {};
}
bool LivePage::wanted(std::chrono::milliseconds) const {
  return false;
}
void LivePage::show(Report) {}
void LivePage::finish(std::string, std::chrono::milliseconds) {}

}  // namespace example

#endif
