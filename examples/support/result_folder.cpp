// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "result_folder.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>

namespace example {
namespace {

namespace fs = std::filesystem;
using Names = std::vector<std::string>;

constexpr std::string_view part_suffix = ".cairn-part";
constexpr std::string_view absence_suffix = ".absent";
constexpr const char* part_inside = ".cairn-part";
constexpr const char* complete_inside = ".cairn-results";

[[noreturn]] void refuse_folder(const fs::path& folder, const std::string& why) {
  cairn::raise(folder.string() + ": cannot write there (" + why + "); expected a writable folder");
}

bool is_result(const std::string& name, const Names& names) {
  return std::ranges::find(names, name) != names.end();
}

/// A result, a mark that there is none, or what write_file_atomically leaves of either when it is killed.
bool is_ours(const fs::path& file, const Names& names) {
  std::string name = file.filename().string();
  name.resize(std::min(name.size(), name.rfind(part_suffix)));
  if (name.ends_with(absence_suffix)) name.resize(name.size() - absence_suffix.size());
  return is_result(name, names);
}

std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> all;
  std::error_code failure;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end; entry.increment(failure))
    all.push_back(entry->path());
  return all;
}

/// An open folder with the lock that says that its run lives. Nothing where it is no folder or locked.
std::optional<cairn::detail::Descriptor> locked(const fs::path& folder) {
  cairn::detail::Descriptor opened(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (!opened || ::flock(opened.number(), LOCK_EX | LOCK_NB) != 0 || !cairn::detail::leads_to(folder, opened))
    return std::nullopt;
  return opened;
}

/// The turn of this run to change what stands in a folder: a lock on it, waited for, of the folder that has
/// the name now and not of one that another run has just put aside. Not held where the folder cannot be
/// opened.
cairn::detail::Descriptor turn_in(const fs::path& folder) {
  for (;;) {
    cairn::detail::Descriptor opened(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!opened || ::flock(opened.number(), LOCK_EX) != 0 || cairn::detail::leads_to(folder, opened))
      return opened;
  }
}

/// Removes the results and their parts in a folder, and the folder. What else has got into it goes to
/// `others`, where it came from.
void dissolve(const fs::path& folder, const Names& names, const fs::path& others) {
  std::error_code ignored;
  for (const fs::path& entry : entries(folder)) {
    if (is_ours(entry, names))
      fs::remove(entry, ignored);
    else if (!fs::exists(fs::symlink_status(others / entry.filename(), ignored)))
      fs::rename(entry, others / entry.filename(), ignored);
  }
  fs::remove(folder, ignored);
}

/// Where the files of a run are completed: beside the results' folder or inside it.
fs::path part_name(const fs::path& folder, bool beside, int number) {
  fs::path part = beside ? folder : folder / part_inside;
  if (beside) part += part_suffix;
  if (number > 0) part += std::to_string(number);
  return part;
}

/// Says in a completed set that a run has no such file.
fs::path absence(const fs::path& complete, std::string name) {
  return complete / name.append(absence_suffix);
}

/// Moves the files of a completed set to their places; can be begun again wherever it was cut short.
void deliver(const fs::path& complete, const fs::path& folder, const Names& names) {
  for (const std::string& name : names) {
    std::error_code failure;
    const fs::path file = complete / name, target = folder / name;
    if (fs::exists(absence(complete, name), failure)) {
      if (fs::is_regular_file(fs::symlink_status(target, failure)) && !fs::remove(target, failure))
        refuse_folder(target, failure.message());
      fs::remove(absence(complete, name), failure);
    }
    if (!fs::exists(file, failure)) continue;
    const fs::file_status there = fs::symlink_status(target, failure);
    if (fs::exists(there) && !fs::is_regular_file(there)) {
      cairn::write_file_atomically(target, cairn::read_file(file));
      fs::remove(file, failure);
    } else if (fs::rename(file, target, failure); failure) {
      refuse_folder(target, failure.message());
    }
  }
  std::error_code ignored;
  fs::remove(complete, ignored);
}

/// Finishes what a run that was killed had begun to deliver, and removes what others left unfinished.
void recover(const fs::path& folder, const Names& names) {
  const fs::path complete = folder / complete_inside;
  if (const auto lock = locked(complete)) deliver(complete, folder, names);
  constexpr int most_killed = 10;
  for (int number = 0; number < most_killed; ++number)
    for (const bool beside : {true, false})
      if (const auto lock = locked(part_name(folder, beside, number)))
        dissolve(part_name(folder, beside, number), names, folder);
}

/// The folder as the kernel names it, so that its parent is the folder above.
fs::path resolved(const fs::path& folder) {
  std::error_code failure;
  const fs::path whole = fs::canonical(folder, failure);
  if (failure) refuse_folder(folder, failure.message());
  return whole;
}

bool same_device(const fs::path& a, const fs::path& b) {
  struct stat first{}, second{};
  return ::stat(a.c_str(), &first) == 0 && ::stat(b.c_str(), &second) == 0 && first.st_dev == second.st_dev;
}

/// Whether the folder may change places with another: nothing but results in it, and nobody of this process
/// stands there.
bool may_be_exchanged(const fs::path& folder, const Names& names) {
#ifdef RENAME_EXCHANGE
  const fs::path above = folder.parent_path();
  std::error_code failure;
  const fs::path here = fs::current_path(failure);
  const auto [end, ignored] = std::ranges::mismatch(folder, here);
  if (failure || end == folder.end()) return false;
  for (const fs::path& written : {above, folder})
    if (::faccessat(AT_FDCWD, written.c_str(), W_OK | X_OK, AT_EACCESS) != 0) return false;
  if (!same_device(above, folder)) return false;
  return std::ranges::all_of(entries(folder), [&](const fs::path& entry) {
    std::error_code unknown;
    return is_result(entry.filename().string(), names) &&
           fs::is_regular_file(fs::symlink_status(entry, unknown));
  });
#else
  return false;
#endif
}

/// What is to be replaced keeps its permissions, and its owner where this process may give it away.
void keep_permissions(const fs::path& from, const fs::path& to) {
  struct stat old{}, made{};
  if (::lstat(from.c_str(), &old) != 0 || S_ISLNK(old.st_mode) || ::stat(to.c_str(), &made) != 0) return;
  ::mode_t mode = old.st_mode & 07777U;
  if ((made.st_uid != old.st_uid || made.st_gid != old.st_gid) &&
      ::chown(to.c_str(), old.st_uid, old.st_gid) != 0)
    mode &= 0777U;
  static_cast<void>(::chmod(to.c_str(), mode));
}

/// A fresh folder under a name that no living run uses, locked; removed with its results at the end unless it
/// was given away.
class Staging {
public:
  /// Beside `folder`, or inside it.
  Staging(const fs::path& folder, const Names& names, bool beside) : folder_(folder), names_(names) {
    for (int number = 0; number < 100; ++number) {
      path_ = part_name(folder, beside, number);
      for (int attempt = 0; attempt < 3; ++attempt) {
        if (::mkdir(path_.c_str(), 0700) == 0) {
          lock_ = locked(path_);
          if (lock_) {
            keep_permissions(folder, path_);  // never open to more readers than the results will be
            return;
          }
        } else if (errno != EEXIST) {
          refuse_folder(folder, std::strerror(errno));
        } else if (const auto stale = locked(path_)) {
          dissolve(path_, names, folder);
        } else {
          break;
        }
      }
    }
    refuse_folder(folder, "too many runs write there");
  }
  ~Staging() {
    if (!path_.empty()) dissolve(path_, names_, folder_);
  }
  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;

  [[nodiscard]] const fs::path& path() const { return path_; }

  /// The folder and this one change places: true, and what was there is now here. False where the file system
  /// cannot.
  [[nodiscard]] bool exchange() const {
#ifdef RENAME_EXCHANGE
    return ::renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, folder_.c_str(), RENAME_EXCHANGE) == 0;
#else
    return false;
#endif
  }

  /// Becomes the completed set inside the folder.
  void complete() {
    for (const std::string& name : names_)
      if (!fs::exists(path_ / name)) cairn::write_file_atomically(absence(path_, name), "");
    const fs::path whole = folder_ / complete_inside;
    if (::rename(path_.c_str(), whole.c_str()) != 0) refuse_folder(folder_, std::strerror(errno));
    path_.clear();
  }

private:
  fs::path folder_;
  const Names& names_;
  fs::path path_;
  std::optional<cairn::detail::Descriptor> lock_;
};

/// Whether two names are of one file, or would be, were it made.
bool same_file(const fs::path& one, const fs::path& other) {
  if (one.empty() || other.empty()) return false;
  std::error_code failure;
  const fs::path a = fs::weakly_canonical(fs::absolute(one, failure), failure);
  return !failure && a == fs::weakly_canonical(fs::absolute(other, failure), failure) && !failure;
}

}  // namespace

ResultFolder::ResultFolder(fs::path folder, Names names)
    : folder_(std::move(folder)), names_(std::move(names)) {}

void ResultFolder::prepare(const std::vector<fs::path>& besides) const {
  std::error_code failure;
  fs::create_directories(folder_, failure);
  if (failure) refuse_folder(folder_, failure.message());
  if (!fs::is_directory(folder_)) refuse_folder(folder_, "not a folder");
  const fs::path folder = resolved(folder_);
  const cairn::detail::Descriptor turn = turn_in(folder);
  recover(folder, names_);
  for (const std::string& name : names_)
    if (fs::is_directory(folder / name, failure))
      cairn::raise((folder_ / name).string() + ": is a folder; expected a file or nothing");
  const Staging proof(folder, names_, false);
  for (auto file = besides.begin(); file != besides.end(); ++file) {
    if (file->empty()) continue;
    if (std::any_of(besides.begin(), file, [&](const fs::path& other) { return same_file(other, *file); }))
      cairn::raise(file->string() + ": expected a name for each file that is to be written");
    if (std::ranges::any_of(names_, [&](const std::string& name) { return same_file(folder / name, *file); }))
      cairn::raise(file->string() + ": a result of the run has this name; expected another");
    const fs::path into = file->has_parent_path() ? file->parent_path() : ".";
    if (!fs::is_directory(into, failure) || fs::is_directory(*file, failure))
      cairn::raise(file->string() + ": expected the name of a file in a folder that there is");
  }
}

void ResultFolder::replace(const std::function<void(const fs::path& staging)>& fill) const {
  prepare();
  const fs::path folder = resolved(folder_);
  // What is begun inside the folder is begun while nobody exchanges it.
  cairn::detail::Descriptor turn = turn_in(folder);
  const bool swaps = may_be_exchanged(folder, names_);
  Staging staging(folder, names_, swaps);
  turn = cairn::detail::Descriptor();
  fill(staging.path());
  for (const fs::path& made : entries(staging.path()))
    CAIRN_EXPECTS(is_result(made.filename().string(), names_), "a run leaves files of the names it gave");
  for (const std::string& name : names_) {
    std::error_code failure;
    if (fs::exists(staging.path() / name, failure)) keep_permissions(folder / name, staging.path() / name);
  }
  turn = turn_in(folder);  // two runs do not deliver into one folder at a time, nor exchange it meanwhile
  if (swaps && may_be_exchanged(folder, names_) && staging.exchange()) return;
  if (fs::exists(folder / complete_inside)) deliver(folder / complete_inside, folder, names_);
  staging.complete();
  deliver(folder / complete_inside, folder, names_);
}

NoEmptyFolder::NoEmptyFolder(const fs::path& folder) {
  std::error_code failure;
  fs::path path = fs::absolute(folder, failure).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();  // "out/"
  for (; !failure && !fs::exists(fs::symlink_status(path, failure)) && path.has_relative_path();
       path = path.parent_path()) {
    missing_.push_back(path);
    failure.clear();  // that it is missing is no failure
  }
}

NoEmptyFolder::~NoEmptyFolder() {
  for (const fs::path& folder : missing_)
    if (::rmdir(folder.c_str()) != 0) return;  // not empty, or never made
}

void expect_not_read(const fs::path& save, const std::vector<fs::path>& read) {
  for (const fs::path& file : read)
    if (same_file(save, file))
      cairn::raise(file.string() + ": is read by this run; expected another name for --save");
}

}  // namespace example
