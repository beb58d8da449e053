// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The files that a run leaves in its folder: those of one run take the place of those of another as one
/// step, also where the program is killed.
///
/// They are completed in a folder of their own. Where the results' folder holds results and nothing else, the
/// two folders then change places in one step. Where that cannot be (other files stand in it, it is a mount
/// point or somebody's working folder, the folder above may not be written, the file system cannot), the
/// completed set is renamed to .cairn-results inside the folder, which is the step, and its files are moved
/// out; if that is cut short, the next run completes it before it begins. What killed runs leave is known by
/// its name (FOLDER.cairn-part, .cairn-part, .cairn-results) and by the lock that a living run holds; the
/// next run removes it. Files that are no results are never touched.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace example {

class ResultFolder {
public:
  /// `names` are all files that a run of this program may leave.
  ResultFolder(std::filesystem::path folder, std::vector<std::string> names);

  /// Makes the folder where it is missing, completes or removes what killed runs left, and proves that
  /// results can be written: before the work, not after it. Throws cairn::Error naming the folder and why.
  /// `besides` are files that the run writes besides its results, or empty: each has to have a name of its
  /// own in a folder that there is.
  void prepare(const std::vector<std::filesystem::path>& besides = {}) const;

  /// Calls fill(staging), which writes files of these names into the folder `staging`. When it returns, those
  /// files are the results, and of `names` no other file is left. Throws cairn::Error, or what `fill` throws,
  /// and leaves the old results. Permissions of files that are replaced are kept; links, devices and pipes of
  /// these names are written through, as cairn::write_file_atomically does.
  void replace(const std::function<void(const std::filesystem::path& staging)>& fill) const;

private:
  std::filesystem::path folder_;
  std::vector<std::string> names_;
};

/// Removes, when it goes, the folders that were missing when it came, where nothing stands in them: a run
/// that made its folder before the work and then fails leaves none.
class NoEmptyFolder {
public:
  explicit NoEmptyFolder(const std::filesystem::path& folder);
  ~NoEmptyFolder();
  NoEmptyFolder(const NoEmptyFolder&) = delete;
  NoEmptyFolder& operator=(const NoEmptyFolder&) = delete;

private:
  std::vector<std::filesystem::path> missing_;  // each in the next
};

/// Throws cairn::Error where the file that is to be written by --save is one of those that the run reads. Any
/// of them may be empty.
void expect_not_read(const std::filesystem::path& save, const std::vector<std::filesystem::path>& read);

}  // namespace example
