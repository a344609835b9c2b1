// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/image_finder.h"

namespace adasfm {
namespace {

std::string FileName(const std::string& path) {
  return path.substr(path.find_last_of('/') + 1);
}

}  // namespace

void ImageFinder::Add(image_t image_id, const std::string& name) {
  by_name_[name] = image_id;
  const auto [entry, is_new] = by_file_name_.emplace(FileName(name), image_id);
  if (!is_new) entry->second = kInvalidImageId;
}

image_t ImageFinder::Find(const std::string& name) const {
  const auto exact = by_name_.find(name);
  if (exact != by_name_.end()) return exact->second;
  const auto similar = by_file_name_.find(FileName(name));
  return similar == by_file_name_.end() ? kInvalidImageId : similar->second;
}

}  // namespace adasfm
