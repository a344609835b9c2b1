// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/image_codecs.h"

#include <dlfcn.h>

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace adasfm {
namespace {

// name: as the Itanium C++ ABI encodes it.
template <typename Function>
Function FindFunction(const char* name) {
  void* const library = dlopen(ADASFM_IMGCODECS_LIBRARY, RTLD_NOW);
  void* const function = library != nullptr ? dlsym(library, name) : nullptr;
  if (function == nullptr) throw std::runtime_error(dlerror());
  return reinterpret_cast<Function>(function);
}

}  // namespace

cv::Mat ReadImageFile(const std::string& path, int flags) {
  static const auto imread = FindFunction<decltype(&cv::imread)>(
      "_ZN2cv6imreadERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEEi");
  return imread(path, flags);
}

std::vector<unsigned char> EncodeImage(const std::string& extension,
                                       const cv::Mat& image,
                                       const std::vector<int>& parameters) {
  static const auto imencode = FindFunction<decltype(&cv::imencode)>(
      "_ZN2cv8imencodeERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEERK"
      "NS_11_InputArrayERSt6vectorIhSaIhEERKSB_IiSaIiEE");
  std::vector<unsigned char> bytes;
  imencode(extension, image, bytes, parameters);
  return bytes;
}

}  // namespace adasfm
