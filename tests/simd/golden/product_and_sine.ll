target triple = "x86_64-unknown-linux-gnu"
define internal void @segment0(ptr noalias nocapture readonly %arguments, i64 %first, ptr noalias nocapture %kept) {
entry:
  %a0 = getelementptr inbounds i64, ptr %arguments, i64 1
  %b0 = load ptr, ptr %a0
  %s0_ = getelementptr inbounds i64, ptr %arguments, i64 2
  %s0 = load i64, ptr %s0_
  %o0 = mul i64 %first, %s0
  %p0_0 = getelementptr inbounds i8, ptr %b0, i64 %o0
  %p0_1 = getelementptr inbounds i8, ptr %p0_0, i64 %s0
  %0 = load <2 x double>, ptr %p0_0, align 8
  %1 = load <2 x double>, ptr %p0_1, align 8
  %2 = shufflevector <2 x double> %0, <2 x double> %1, <2 x i32> <i32 0, i32 2>
  %3 = shufflevector <2 x double> %0, <2 x double> %1, <2 x i32> <i32 1, i32 3>
  %4 = call <2 x double> @llvm.fabs.v2f64(<2 x double> %2)
  %5 = fcmp ogt <2 x double> %4, splat (double 0x40F86A0000000000)
  %6 = or <2 x i1> zeroinitializer, %5
  %7 = call <2 x double> @llvm.fma.v2f64(<2 x double> %4, <2 x double> splat (double 0x3FE45F306DC9C883), <2 x double> splat (double 0x4338000000000000))
  %8 = bitcast <2 x double> %7 to <2 x i64>
  %9 = fsub <2 x double> %7, splat (double 0x4338000000000000)
  %10 = call <2 x double> @llvm.fma.v2f64(<2 x double> %9, <2 x double> splat (double 0xBFF921FB54442D18), <2 x double> %4)
  %11 = call <2 x double> @llvm.fma.v2f64(<2 x double> %9, <2 x double> splat (double 0xBC91A62633145C07), <2 x double> %10)
  %12 = call <2 x double> @llvm.fma.v2f64(<2 x double> %9, <2 x double> splat (double 0x391F1976B7ED8FBC), <2 x double> %11)
  %13 = fmul <2 x double> %12, %12
  %14 = call <2 x double> @llvm.fma.v2f64(<2 x double> splat (double 0x3DE5D8FA31EAA9E0), <2 x double> %13, <2 x double> splat (double 0xBE5AE5E59F595795))
  %15 = call <2 x double> @llvm.fma.v2f64(<2 x double> %14, <2 x double> %13, <2 x double> splat (double 0x3EC71DE3567125EC))
  %16 = call <2 x double> @llvm.fma.v2f64(<2 x double> %15, <2 x double> %13, <2 x double> splat (double 0xBF2A01A019BFD181))
  %17 = call <2 x double> @llvm.fma.v2f64(<2 x double> %16, <2 x double> %13, <2 x double> splat (double 0x3F8111111110F7CA))
  %18 = call <2 x double> @llvm.fma.v2f64(<2 x double> %17, <2 x double> %13, <2 x double> splat (double 0xBFC5555555555548))
  %19 = fmul <2 x double> %13, %12
  %20 = call <2 x double> @llvm.fma.v2f64(<2 x double> %18, <2 x double> %19, <2 x double> %12)
  %21 = call <2 x double> @llvm.fma.v2f64(<2 x double> splat (double 0xBDA8FA465DD74BCA), <2 x double> %13, <2 x double> splat (double 0x3E21EE9D7526EF7C))
  %22 = call <2 x double> @llvm.fma.v2f64(<2 x double> %21, <2 x double> %13, <2 x double> splat (double 0xBE927E4F7EA3760B))
  %23 = call <2 x double> @llvm.fma.v2f64(<2 x double> %22, <2 x double> %13, <2 x double> splat (double 0x3EFA01A019C8390A))
  %24 = call <2 x double> @llvm.fma.v2f64(<2 x double> %23, <2 x double> %13, <2 x double> splat (double 0xBF56C16C16C14F8A))
  %25 = call <2 x double> @llvm.fma.v2f64(<2 x double> %24, <2 x double> %13, <2 x double> splat (double 0x3FA555555555554B))
  %26 = call <2 x double> @llvm.fma.v2f64(<2 x double> %25, <2 x double> %13, <2 x double> splat (double 0xBFE0000000000000))
  %27 = call <2 x double> @llvm.fma.v2f64(<2 x double> %26, <2 x double> %13, <2 x double> splat (double 0x3FF0000000000000))
  %28 = shl <2 x i64> %8, splat (i64 63)
  %29 = icmp slt <2 x i64> %28, zeroinitializer
  %30 = select <2 x i1> %29, <2 x double> %27, <2 x double> %20
  %31 = select <2 x i1> %29, <2 x double> %20, <2 x double> %27
  %32 = add <2 x i64> %8, splat (i64 1)
  %33 = bitcast <2 x double> %2 to <2 x i64>
  %34 = shl <2 x i64> %8, splat (i64 62)
  %35 = xor <2 x i64> %34, %33
  %36 = shl <2 x i64> %32, splat (i64 62)
  %37 = and <2 x i64> %35, splat (i64 -9223372036854775808)
  %38 = bitcast <2 x double> %30 to <2 x i64>
  %39 = xor <2 x i64> %38, %37
  %40 = bitcast <2 x i64> %39 to <2 x double>
  %41 = and <2 x i64> %36, splat (i64 -9223372036854775808)
  %42 = bitcast <2 x double> %31 to <2 x i64>
  %43 = xor <2 x i64> %42, %41
  %44 = bitcast <2 x i64> %43 to <2 x double>
  %45 = bitcast <2 x i1> %6 to i2
  %46 = icmp ne i2 %45, 0
  br label %near1
near1:
  br i1 %46, label %far2, label %trig3, !prof !0
far2:
  %47 = call <2 x double> @beyond_limit_sin(<2 x double> %2, <2 x double> %40)
  %48 = call <2 x double> @beyond_limit_cos(<2 x double> %2, <2 x double> %44)
  br label %trig3
trig3:
  %49 = phi <2 x double> [%40, %near1], [%47, %far2]
  %50 = phi <2 x double> [%44, %near1], [%48, %far2]
  %51 = fmul <2 x double> %2, %3
  %52 = fadd <2 x double> %51, %49
  %a1 = getelementptr inbounds i64, ptr %arguments, i64 3
  %b1 = load ptr, ptr %a1
  %s1_ = getelementptr inbounds i64, ptr %arguments, i64 4
  %s1 = load i64, ptr %s1_
  %o1 = mul i64 %first, %s1
  %p1_0 = getelementptr inbounds i8, ptr %b1, i64 %o1
  %adjacent1 = icmp eq i64 %s1, 8
  br i1 %adjacent1, label %store_all1, label %store_each1
store_all1:
  store <2 x double> %52, ptr %p1_0, align 8
  br label %stored1
store_each1:
  %p1_1 = getelementptr inbounds i8, ptr %p1_0, i64 %s1
  %x1_0 = extractelement <2 x double> %52, i32 0
  store double %x1_0, ptr %p1_0, align 8
  %x1_1 = extractelement <2 x double> %52, i32 1
  store double %x1_1, ptr %p1_1, align 8
  br label %stored1
stored1:
  ret void
}
define void @kernel(ptr noalias nocapture readonly %arguments) {
entry:
  %kept = alloca [1 x <2 x double>], align 64
  %n = load i64, ptr %arguments
  %last = sub i64 %n, 2
  br label %group
group:
  %i = phi i64 [0, %entry], [%next, %group]
  %late = icmp sgt i64 %i, %last
  %first = select i1 %late, i64 %last, i64 %i
  call void @segment0(ptr %arguments, i64 %first, ptr %kept)
  %next = add i64 %i, 2
  %more = icmp slt i64 %next, %n
  br i1 %more, label %group, label %done
done:
  ret void
}
define internal <2 x double> @beyond_limit_sin(<2 x double> %x, <2 x double> %near) cold noinline {
entry:
  %0 = extractelement <2 x double> %x, i32 0
  %1 = call double @sin(double %0)
  %2 = call double @llvm.fabs.f64(double %0)
  %3 = fcmp ogt double %2, 0x40F86A0000000000
  %4 = extractelement <2 x double> %near, i32 0
  %5 = select i1 %3, double %1, double %4
  %6 = insertelement <2 x double> %near, double %5, i32 0
  %7 = extractelement <2 x double> %x, i32 1
  %8 = call double @sin(double %7)
  %9 = call double @llvm.fabs.f64(double %7)
  %10 = fcmp ogt double %9, 0x40F86A0000000000
  %11 = extractelement <2 x double> %6, i32 1
  %12 = select i1 %10, double %8, double %11
  %13 = insertelement <2 x double> %6, double %12, i32 1
  ret <2 x double> %13
}
define internal <2 x double> @beyond_limit_cos(<2 x double> %x, <2 x double> %near) cold noinline {
entry:
  %0 = extractelement <2 x double> %x, i32 0
  %1 = call double @cos(double %0)
  %2 = call double @llvm.fabs.f64(double %0)
  %3 = fcmp ogt double %2, 0x40F86A0000000000
  %4 = extractelement <2 x double> %near, i32 0
  %5 = select i1 %3, double %1, double %4
  %6 = insertelement <2 x double> %near, double %5, i32 0
  %7 = extractelement <2 x double> %x, i32 1
  %8 = call double @cos(double %7)
  %9 = call double @llvm.fabs.f64(double %7)
  %10 = fcmp ogt double %9, 0x40F86A0000000000
  %11 = extractelement <2 x double> %6, i32 1
  %12 = select i1 %10, double %8, double %11
  %13 = insertelement <2 x double> %6, double %12, i32 1
  ret <2 x double> %13
}
declare <2 x double> @llvm.fabs.v2f64(<2 x double>)
declare <2 x double> @llvm.fma.v2f64(<2 x double>, <2 x double>, <2 x double>)
declare <2 x double> @llvm.sqrt.v2f64(<2 x double>)
declare double @llvm.fabs.f64(double)
declare double @sin(double)
declare double @cos(double)
!0 = !{!"branch_weights", i32 1, i32 100000}
declare void @llvm.prefetch.p0(ptr, i32, i32, i32)
