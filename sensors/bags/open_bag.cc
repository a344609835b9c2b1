// SPDX-License-Identifier: BSD-3-Clause
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <tuple>
#include <utility>

#include "sensors/bags/bag_reader.h"
#include "sensors/bags/db3_bag.h"
#include "sensors/bags/mcap_bag.h"
#include "sensors/bags/ros1_bag.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

bool IsBagFile(const fs::path& path) {
  const fs::path extension = path.extension();
  return extension == ".mcap" || extension == ".db3" || extension == ".bag";
}

// The files of a rosbag2 folder in the order of their recording, by its
// metadata.yaml; without one (the recorder was killed) in the order of names.
StatusOr<std::vector<std::string>> ListFolder(const std::string& folder) {
  std::vector<std::string> files;
  const std::string metadata_path = folder + "/metadata.yaml";
  if (fs::exists(metadata_path)) {
    try {
      std::ifstream stream(metadata_path);
      const YAML::Node names = YAML::Load(
          stream)["rosbag2_bagfile_information"]["relative_file_paths"];
      for (const YAML::Node& name : names) {
        files.push_back(folder + "/" + name.as<std::string>());
      }
    } catch (const YAML::Exception&) {
      return Status::Error(metadata_path +
                           ": not readable as YAML; give the bag's file "
                           "instead of its folder");
    }
  }
  std::error_code error;
  if (files.empty()) {
    for (const fs::directory_entry& entry :
         fs::directory_iterator(folder, error)) {
      if (IsBagFile(entry.path())) files.push_back(entry.path().string());
    }
    std::sort(files.begin(), files.end());
  }
  for (const std::string& file : files) {
    if (fs::path(file).extension() == ".zstd") {
      return Status::Error(file +
                           ": the file is compressed as a whole; decompress "
                           "it with zstd -d, and give the result");
    }
  }
  if (!files.empty()) return files;
  return Status::Error(folder +
                       ": the folder has no .mcap and no .db3 file; is it a "
                       "rosbag2 recording?");
}

StatusOr<std::unique_ptr<BagReader>> OpenFile(const std::string& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) {
    return Status::Error(path + ": no such file; check the path");
  }
  const fs::path extension = fs::path(path).extension();
  if (extension == ".mcap") return OpenMcapBag(path);
  if (extension == ".db3") return OpenDb3Bag(path);
  if (extension == ".bag") return OpenRos1Bag(path);
  return Status::Error(path +
                       ": not a bag by its name (.mcap, .db3, .bag, or a "
                       "rosbag2 folder)");
}

// Files of one recording, one after the other.
class SplitBag : public BagReader {
 public:
  explicit SplitBag(std::vector<std::unique_ptr<BagReader>> parts)
      : parts_(std::move(parts)) {
    for (const auto& part : parts_) {
      topics_.insert(topics_.end(), part->Topics().begin(),
                     part->Topics().end());
    }
    SortTopics(&topics_);
  }

  const std::vector<BagTopic>& Topics() const override { return topics_; }

  Status Read(const std::set<std::string>& topics, const BagVisitor& visit,
              std::vector<std::string>* warnings) override {
    for (const auto& part : parts_) {
      const Status status = part->Read(topics, visit, warnings);
      if (!status.ok()) return status;
    }
    return Status::Ok();
  }

 private:
  std::vector<std::unique_ptr<BagReader>> parts_;
  std::vector<BagTopic> topics_;
};

}  // namespace

StatusOr<std::unique_ptr<BagReader>> OpenBag(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return OpenFile(path);
  const StatusOr<std::vector<std::string>> files = ListFolder(path);
  if (!files.ok()) return files.status();
  std::vector<std::unique_ptr<BagReader>> parts;
  for (const std::string& file : *files) {
    StatusOr<std::unique_ptr<BagReader>> part = OpenFile(file);
    if (!part.ok()) return part.status();
    parts.push_back(std::move(part).value());
  }
  return std::unique_ptr<BagReader>(
      std::make_unique<SplitBag>(std::move(parts)));
}

bool IsBag(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) {
    // A name such as ".bag" has no extension.
    return IsBagFile(path);
  }
  if (fs::exists(path + "/metadata.yaml", error)) return true;
  for (const fs::directory_entry& entry : fs::directory_iterator(path, error)) {
    if (IsBagFile(entry.path())) return true;
  }
  return false;
}

std::string NormalizeRosType(const std::string& type) {
  const size_t infix = type.find("/msg/");
  return infix == std::string::npos
             ? type
             : type.substr(0, infix) + type.substr(infix + 4);
}

void SortTopics(std::vector<BagTopic>* topics) {
  const auto key = [](const BagTopic& topic) {
    return std::tie(topic.name, topic.type);
  };
  std::sort(
      topics->begin(), topics->end(),
      [&key](const BagTopic& a, const BagTopic& b) { return key(a) < key(b); });
  topics->erase(std::unique(topics->begin(), topics->end(),
                            [&key](const BagTopic& a, const BagTopic& b) {
                              return key(a) == key(b);
                            }),
                topics->end());
}

}  // namespace adasfm
