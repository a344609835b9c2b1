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
  by_file_name_[FileName(name)].push_back(image_id);
}

image_t ImageFinder::Find(const std::string& name) const {
  const std::vector<image_t> found = FindAll(name);
  return found.size() == 1 ? found.front() : kInvalidImageId;
}

std::vector<image_t> ImageFinder::FindAll(const std::string& name) const {
  const auto exact = by_name_.find(name);
  if (exact != by_name_.end()) return {exact->second};
  const auto similar = by_file_name_.find(FileName(name));
  return similar == by_file_name_.end() ? std::vector<image_t>()
                                        : similar->second;
}

}  // namespace adasfm
